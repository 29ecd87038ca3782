"""A calibration in one picture: corners, residuals, and each view's error."""

from __future__ import annotations

import numpy as np

from tacdata.tags.calibration.intrinsics import CELLS, Calibration

WIDTH = 900
"""Width of the drawn image [px of the picture]."""
BAR = 14
"""Height of a view's bar [px of the picture]."""
ARROW = 40.0
"""Magnification of a residual's stroke [1]."""
INK, FAINT, USED, DROPPED = (40, 40, 40), (215, 215, 215), (160, 90, 20), (60, 60, 210)


def draw_calibration(calibration: Calibration) -> np.ndarray:
    """Return the picture, BGR uint8, shape (height, width, 3)."""
    import cv2

    scale = WIDTH / calibration.size[0]
    height, top, left = round(calibration.size[1] * scale), 60, 20
    chart = WIDTH + 2 * left
    rows = max(height + top + 40, top + (BAR + 3) * len(calibration.views) + 40)
    picture = np.full((rows, chart + 460, 3), 255, np.uint8)
    _write(picture, _title(calibration), (left, 24), 0.55)
    _write(picture, f"corners, and what the fit leaves x {ARROW:.0f}", (left, 48), 0.45)
    for k in range(CELLS[0] + 1):
        x = left + round(k * WIDTH / CELLS[0])
        cv2.line(picture, (x, top), (x, top + height), FAINT, 1)
    for k in range(CELLS[1] + 1):
        y = top + round(k * height / CELLS[1])
        cv2.line(picture, (left, y), (left + WIDTH, y), FAINT, 1)
    for used in calibration.views:
        places = (used.view.corners * scale + (left, top)).round().astype(int)
        strokes = np.zeros_like(used.view.corners) if used.residuals is None else used.residuals
        ends = ((used.view.corners + ARROW * strokes) * scale + (left, top)).round().astype(int)
        for start, end in zip(places.tolist(), ends.tolist(), strict=True):
            cv2.circle(picture, start, 2, DROPPED if used.reason else USED, -1, cv2.LINE_AA)
            cv2.line(picture, start, end, INK, 1, cv2.LINE_AA)
    _bars(picture, calibration, (chart, top))
    return picture


def _title(calibration: Calibration) -> str:
    named = zip(
        ("fx", "fy", "cx", "cy"), calibration.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], calibration.spread, strict=True
    )
    numbers = "  ".join(f"{name} {value:.2f} +- {spread:.2f}" for name, value, spread in named)
    return f"{numbers} px   {calibration.model}   rms {calibration.rms:.3f} px, held out {calibration.held_out_rms:.3f}"


def _bars(picture: np.ndarray, calibration: Calibration, corner: tuple[int, int]) -> None:
    import cv2

    x, y = corner
    _write(picture, "rms of each view [px]", (x, y - 12), 0.45)
    peak = max((used.rms for used in calibration.views if np.isfinite(used.rms)), default=1.0)
    for k, used in enumerate(calibration.views):
        base = y + k * (BAR + 3)
        length = round(200 * (used.rms / peak if np.isfinite(used.rms) else 0))
        cv2.rectangle(picture, (x, base), (x + length, base + BAR), DROPPED if used.reason else USED, -1)
        label = f"{used.rms:.2f}  {used.view.name[-28:]}" + ("  dropped" if used.reason else "")
        _write(picture, label, (x + 208, base + BAR - 3), 0.38)


def _write(picture: np.ndarray, text: str, place: tuple[int, int], size: float) -> None:
    import cv2

    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)
