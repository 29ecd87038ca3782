"""Readings without contact, from the phase of rest or, without phases, from the path."""

from __future__ import annotations

import numpy as np

from tacdata.recording.episode import PHASES, Episode

LOW = 0.02
"""Share of the stroke, from its highest point, within which nothing is pressed [1]."""
FEWEST = 5
"""Readings that a stretch needs for an estimate of noise."""


def idle_rows(episode: Episode) -> np.ndarray:
    """Return which readings were taken without contact, shape (n,), bool.

    Those of the phase of rest; in a path without phases, which holds several presses, those before the first of them,
    or the longest stretch between two.
    """
    time_ns = episode.taxels.sample_ns
    if episode.phases or len(episode.tip_ns) < 2 or not len(time_ns):
        return episode.phase_at(time_ns) == PHASES.index("rest")
    depth = episode.tip_at(time_ns)[:, 2]
    highest, deepest = float(episode.tip[:, 2].min()), float(episode.tip[:, 2].max())
    surface = max(0.0, highest) if deepest > 0 else highest
    mask = (depth <= surface + LOW * (deepest - highest)) & (deepest > highest)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    rows = np.zeros(len(time_ns), dtype=bool)
    if len(begins):
        # A recording usually begins at rest. Later stretches above the skin may still recover from a press.
        first = begins[0] == 0 and ends[0] >= FEWEST
        longest = 0 if first else int(np.argmax(ends - begins))
        rows[begins[longest] : ends[longest]] = True
    return rows
