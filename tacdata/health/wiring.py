"""Channels that are dead, swapped, tied, stuck or no numbers, seen over all presses of a visit."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.health.response import PressResponse
from tacdata.recording.check.channel_order import (
    SILENT,
    Answers,
    answers,
    exchanged,
    fit_answers,
    likelihood,
    misplaced,
)
from tacdata.recording.check.figures import RecordingFigures

EXPECTED = 30.0
"""Response that must be expected of a channel before its silence counts [times the noise]."""
SHARE = 0.05
"""Part of the expected response that a dead channel does not reach [1]: a neighbour's crosstalk may."""
MOST = 0.5
"""Share of the recordings that must show a fault of the wiring [1]: it lasts."""


@dataclass(frozen=True)
class Wiring:
    """Faults of the channels at a visit."""

    dead: tuple[int, ...] = ()
    """Channels that do not respond where they should, or do not change."""
    swapped: tuple[tuple[int, int], ...] = ()
    """Channel, and the taxel whose pattern it has."""
    tied: tuple[tuple[int, int], ...] = ()
    """Pairs of channels that read the same."""
    undefined: tuple[int, ...] = ()
    """Channels whose readings are no numbers."""
    saturated: tuple[int, ...] = ()
    """Channels that ran into a limit."""

    @property
    def unfit(self) -> frozenset[int]:
        """Channels whose gain carries no information."""
        return frozenset({*self.dead, *self.undefined, *(k for pair in self.tied for k in pair)})


def wiring(
    entries: list[RecordingFigures], measured: Sequence[PressResponse], reference: Sequence[PressResponse] | None
) -> Wiring:
    """Return the faults.

    Args:
        entries: Figures of the recordings that are used.
        measured: Responses of the channels to each.
        reference: Their earlier or predicted responses; None to compare with a round pattern alone.
    """
    sample = answers(entries)
    if sample is None:
        return Wiring()
    stuck, undefined, saturated = (_lasting(entries, name) for name in ("stuck", "undefined", "saturated"))
    pairs = Counter((k, j) for entry in entries for k, j in entry.document["taxels"]["tied"])
    tied = tuple(sorted(pair for pair, n in pairs.items() if n >= MOST * len(entries)))
    sample = replace(sample, response=np.nan_to_num(np.array([p.hold for p in measured])))
    expected = fit_answers(sample).pattern if reference is None else _scaled(reference, sample)
    # Half a count is the least noise of a board. Readings in pF have less, and a reference shows what is due.
    quiet = answers(entries, 0.0) if reference is not None else None
    silent = _silent(replace(sample, noise=quiet.noise) if quiet else sample, expected)
    dead = tuple(sorted({*stuck, *silent} - set(undefined)))
    swaps = misplaced(sample) if reference is None else exchanged(likelihood(sample, expected))
    # A dead channel fits anywhere.
    swapped = tuple((k, j) for k, j in swaps.items() if k not in dead and j not in dead)
    return Wiring(dead, swapped, tied, undefined, saturated)


def _lasting(entries: list[RecordingFigures], name: str) -> tuple[int, ...]:
    """Return the channels that most recordings list under a name."""
    counts = Counter(k for entry in entries for k in entry.document["taxels"][name])
    return tuple(sorted(k for k, n in counts.items() if n >= MOST * len(entries)))


def _scaled(reference: Sequence[PressResponse], sample: Answers) -> np.ndarray:
    """Return the reference's responses [counts], shape (presses, taxels), as strong as those found."""
    expected = np.array([press.hold for press in reference])
    strong = expected > 0.2 * expected.max(axis=1, keepdims=True)
    ratio = sample.response[strong] / expected[strong]
    # Dead channels would pull the median down.
    alive = ratio[ratio > SHARE]
    return expected * (float(np.median(alive)) if len(alive) else 1.0)


def _silent(sample: Answers, expected: np.ndarray) -> list[int]:
    """Return the channels without a response where a clear one is expected; a swapped one responds elsewhere."""
    due, response = expected.max(axis=0), np.abs(sample.response).max(axis=0)
    silent = (due > EXPECTED * sample.noise) & (response < np.maximum(SILENT * sample.noise, SHARE * due))
    return np.flatnonzero(silent).tolist()
