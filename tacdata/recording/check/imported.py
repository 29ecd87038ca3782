"""Findings about imported recordings, of which less is demanded than of our own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.episode import Episode

GAP_PERIODS = 5.0
"""Warning threshold: time without a sample [periods]."""


def is_imported(episode: Episode) -> bool:
    """Whether `tacdata import` made the recording."""
    return "imported" in episode.rig


def imported_summary(entries: Sequence[RecordingFigures]) -> list[str]:
    """Summarize imported recordings; times are in the source's unit."""
    taxels = [entry.document["taxels"] for entry in entries]
    noise = [v for t in taxels for v in t["idle_noise"] if v is not None]
    rates = [t["rate"] for t in taxels if t["rate"]]
    spread = float(np.median([t["interval_spread"] for t in taxels]))
    rate = float(np.median(rates)) if rates else np.nan
    noise_text = f"{np.median(noise):.3g} {taxels[0]['unit']}" if noise else "not known"
    reports = [entry.document["cnc"]["rate"] for entry in entries if entry.document["cnc"]["rate"]]
    lines = [
        f"  taxels    {rate:.2f} Hz, {sum(t['frames'] for t in taxels)} rows, the time between two varies by "
        f"{spread:.2g} ms ({spread * rate / 10:.2g} %), idle noise {noise_text}"
    ]
    return lines + ([f"  position  {np.median(reports):.1f} rows/s"] if reports else [])


def imported_findings(figures: RecordingFigures) -> list[tuple[str, str, str]]:
    """Return (severity, stream, text) of the faults and doubts of an imported recording."""
    episode, values = figures.recording.episode, figures.document["taxels"]
    if values["frames"] < 2:
        return [("unusable", "taxels", f"{values['frames']} frames")]
    if not len(episode.tip_ns):
        return [("unusable", "position", "no position and no schedule")]
    judgements = []
    if stand_ins := [text.split(":")[0] for text in episode.rig["imported"].get("stand_ins", [])]:
        text = f"the source does not say {', '.join(stand_ins)}: what stands in makes depth or labels a guess"
        judgements.append(("warning", "import", text))
    judgements += [("warning", "import", text) for text in episode.rig["imported"].get("set_aside", [])]
    if values["rate"] and values["longest_gap"] > GAP_PERIODS * 1000 / values["rate"]:
        judgements.append(("warning", "taxels", f"gaps of up to {values['longest_gap'] / 1000:.1f} s without a sample"))
    missing = np.isnan(episode.taxels.counts).mean(axis=0)
    if (missing == 1).any():
        dead = ", ".join(map(str, np.flatnonzero(missing == 1).tolist()))
        judgements.append(("warning", "taxels", f"channel {dead} has no value at all"))
    if ((missing > 0) & (missing < 1)).any():
        text = f"up to {100 * missing[missing < 1].max():.0f} % of a channel's values are missing"
        judgements.append(("warning", "taxels", text))
    lost = figures.recording.counts.get("taxels", {}).get("lost", 0)
    if lost:
        judgements.append(("warning", "taxels", f"{lost} frames lost by the source's counter"))
    if not episode.phases:
        judgements.append(("warning", "recording", "the path is not of one whole press: its phases are not marked"))
    for text, span in (
        ("begins before", episode.tip_ns[0] - episode.taxels.sample_ns[0]),
        ("ends after", episode.taxels.sample_ns[-1] - episode.tip_ns[-1]),
    ):
        if span > 1_000_000_000:
            judgements.append(
                ("warning", "position", f"the channels' time {text} the position's by {span / 1e9:.1f} s")
            )
    return judgements
