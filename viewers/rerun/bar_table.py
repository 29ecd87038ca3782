"""Bars as a Markdown table, for viewers whose bars carry no names."""

import numpy as np

from tacdata.viewers.scene.scene import Bars

LONGEST = 24
"""Letters of the longest bar."""
BLOCK = "█"


def bar_table(bars: Bars) -> str:
    """Return a table: name, value, and a bar as long as the value (or as its logarithm)."""
    values = np.asarray(bars.values, float)
    positive = values[np.isfinite(values) & (values > 0)]
    low, high = (positive.min() / 2, positive.max()) if len(positive) else (0.5, 1.0)
    lines = ["| | value | |", "|:--|--:|:--|"]
    for label, value in zip(bars.labels, values.tolist(), strict=True):
        share = 0.0
        if np.isfinite(value) and value > 0:
            share = np.log(value / low) / np.log(high / low) if bars.logarithmic else value / high
        mark = "" if bars.mark is None or not np.isfinite(value) else ("▲ " if value > bars.mark else "")
        text = f"{value:.3g}" if np.isfinite(value) else "unknown"
        lines.append(f"| {label} | {text} | {mark}{BLOCK * max(round(LONGEST * share), 0)} |")
    if bars.mark is not None:
        lines += ["", f"▲ above {bars.mark:g}" + ("; bars are logarithmic" if bars.logarithmic else "")]
    return "\n".join(lines)
