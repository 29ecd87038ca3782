"""Tests that a further effect is not just model error of another, or part of the unexplained remainder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tacdata.discrepancy.levels.lack_of_fit import CLEAR_GAIN, CLEAR_T, Lack, surely_elsewhere
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.effects import Family

LEFT_T = 2.0
"""Leftovers: they count from so many standard errors over episodes on [1]."""
SHARE_LEFT_ALONE = 0.15
"""Leftovers: largest share of the explainable that one effect may leave, of which every rival leaves twice as much."""


def stands_in(found: Findings, finding: FoundEffect, lacking: Mapping[Family, Lack]) -> bool:
    """Return whether an effect may be model error of another, or part of the common remainder.

    Its own part is small compared with these. (A form that is wrong by a tenth leaves a hundredth of its explained
    part.) The part that an unnamed family explains counts as remainder. For a single effect, see `adequate`.
    """
    if len(found.effects) < 2 or finding.corrected_p is None:
        return False
    if lent(found, finding):
        return True
    further = finding.bought < max(f.bought for f in found.effects if f.corrected_p is not None)
    if further and found.left.gain >= max(finding.bought, CLEAR_GAIN) and found.left.t >= CLEAR_T:
        return True  # more is left than it explains: less of that need be sure
    left = max(_left(found), *(lacking[family].gain for family in surely_elsewhere(found, lacking)), 0.0)
    return left > 0 and left >= SHARE_LEFT_ALONE * (left + max(finding.bought, 0.0))


def lent(found: Findings, finding: FoundEffect) -> bool:
    """Return whether an effect explains no more than another's form may leave."""
    return finding.bought < form_error(found)


def form_error(found: Findings) -> float:
    """Return the model error of an effect's form: half a whitened sum of squares [1]."""
    raced = [f for f in found.effects if f.corrected_p is not None]
    return max((f.placed.effect.form_error**2 * f.bought for f in raced), default=0.0)


def beside_open(found: Findings, answer: list[FoundEffect], levels: list[Level | None]) -> list[Level | None]:
    """Return the levels that hold while other effects of the answer are open: these count as left over, too.

    The effect that explains most has a name, whatever else of the answer may be something else.
    """
    left = _left(found) + sum(max(f.bought, 0.0) for f, level in zip(answer, levels, strict=True) if level is None)
    large = [left < SHARE_LEFT_ALONE * (left + max(f.bought, 0.0)) for f in answer]
    return [level if much else None for level, much in zip(levels, large, strict=True)]


def traded(answer: Sequence[FoundEffect], levels: Sequence[Level | None]) -> list[bool]:
    """Return of each effect whether it was found by calibration while an unnamed one may replace it.

    The two are collinear: each may compensate a false part of the other.
    """
    nameless = {f.placed.effect.called for f, level in zip(answer, levels, strict=True) if level is None}
    return [f.corrected_p is None and bool(nameless & set(f.rivals)) for f in answer]


def _left(found: Findings) -> float:
    """Return the certain part of the residual [half the whitened sum of squares, held out]."""
    return found.left.gain if found.left.t >= LEFT_T else 0.0
