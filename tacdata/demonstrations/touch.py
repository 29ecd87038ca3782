"""Touch of a finger: tared readings on the demonstration's grid, and faults of its board."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tacdata.recording.episode import TaxelStream

REST = 0.5
"""Length of the quietest stretch, which counts as untouched [s]."""
SILENT = 0.5
"""Time without data after which a board counts as silent [s]."""
FELT = 0.1
"""Threshold of touch: share of the strongest reading's maximum [1]."""
ODD = 0.05
"""Share of novel readings that is reported [1]; a tenth of a percent to a few are normal."""
ALIEN = 1.5
"""Novelty, relative to that of validation data, above which an estimate is called a guess [1]."""
TOUCH = 8.0
"""Rise of a reading, over its noise, from which a taxel counts as touched [1]."""


def baseline(stream: TaxelStream) -> np.ndarray:
    """Return the reading of each taxel without touch [counts], shape (taxels,).

    A demonstration has no marked rest. Touch closes the taxels and raises their capacitance. So the stretch of `REST`
    with the lowest sum of all readings counts as untouched.
    """
    rows = max(min(round(REST / _period(stream)), len(stream.counts)), 1)
    total = np.concatenate([[0.0], np.cumsum(stream.counts.sum(axis=1))])
    start = int(np.argmin(total[rows:] - total[:-rows]))
    return stream.counts[start : start + rows].mean(axis=0)


def on_grid(stream: TaxelStream, values: np.ndarray, times_ns: np.ndarray) -> np.ndarray:
    """Return the value of the nearest frame at each time; NaN where none is within 1.5 periods.

    Args:
        stream: The board's frames, shape (m,).
        values: One value per frame, shape (m, ...).
        times_ns: Times [ns], shape (n,).
    """
    result = np.full((len(times_ns), *values.shape[1:]), np.nan, np.float32)
    if not len(values):
        return result
    last = len(values) - 1
    upper = np.clip(np.searchsorted(stream.sample_ns, times_ns), min(1, last), last)
    lower = np.maximum(upper - 1, 0)
    is_nearer = times_ns - stream.sample_ns[lower] < stream.sample_ns[upper] - times_ns
    nearest = np.where(is_nearer, lower, upper)
    # A reading farther away is of another moment: a gap of the board must stay a gap.
    near = np.abs(stream.sample_ns[nearest] - times_ns) <= 1.5e9 * _period(stream)
    result[near] = values[nearest[near]]
    return result


def faults(name: str, stream: TaxelStream, begin_ns: int, end_ns: int) -> list[str]:
    """Describe the faults of a board's signal: none, silent for a while, stuck channels, never touched."""
    if len(stream.counts) < 2:
        return [f"{name}: its board gave no signal"]
    remarks = []
    edges = np.concatenate([[begin_ns], stream.sample_ns, [end_ns]])
    for a, b in pairwise(edges):
        if b - a > SILENT * 1e9:
            when = (
                f"from {(a - begin_ns) * 1e-9:.1f} s to the end"
                if b == end_ns
                else (f"from {(a - begin_ns) * 1e-9:.1f} to {(b - begin_ns) * 1e-9:.1f} s")
            )
            remarks.append(f"{name}: its board is silent {when}")
    spread = np.ptp(stream.counts, axis=0)
    stuck = np.flatnonzero(spread == 0)
    if len(stuck) == stream.counts.shape[1]:
        remarks.append(f"{name}: no reading of its board ever changes: it is not connected to a skin")
    elif len(stuck):
        remarks.append(f"{name}: channels {', '.join(map(str, stuck))} never change")
    # Readings of a coarse board may not change at all at rest: one count is its resolution.
    noise = np.median(np.abs(np.diff(stream.counts, axis=0)), axis=0) + 1.0
    if len(stuck) < len(spread) and (spread < TOUCH * noise).all():
        remarks.append(f"{name}: its board speaks, but nothing ever touched the finger")
    return remarks


def unknown(name: str, signals: np.ndarray, novelty: np.ndarray) -> list[str]:
    """Describe for which share of a finger's touches the network has not been trained on similar readings.

    Args:
        name: The finger.
        signals: Tared readings [counts], shape (n, taxels).
        novelty: Novelty of the readings [1], shape (n,).
    """
    mask = np.isfinite(novelty) & np.isfinite(signals).all(axis=1)
    # Only clear touch is judged: near zero every reading lies close to those of training.
    strongest = np.max(signals[mask], axis=1, initial=0.0)
    touching = novelty[mask][strongest > FELT * np.max(strongest, initial=0.0)]
    strange = touching > 1.0
    if len(touching) == 0 or strange.mean() <= ODD:
        return []
    peak = float(touching.max())
    how, what = "just outside of", "may be off there"
    if peak > ALIEN:
        how, what = "unlike all of", "is a guess there"
    return [
        f"{name}: {strange.mean():.0%} of its touch is {how} what the network learnt from (up to {peak:.2f} times as "
        f"far from it as its validation presses): the predicted depth {what}; train on contacts as wide and as deep"
    ]


def _period(stream: TaxelStream) -> float:
    return max(float(np.median(np.diff(stream.sample_ns))) * 1e-9, 1e-4) if len(stream.sample_ns) > 1 else 1.0
