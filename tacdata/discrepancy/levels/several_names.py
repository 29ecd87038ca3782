"""Tests that a further effect is not just model error of another, or part of the unexplained remainder."""

from __future__ import annotations

from collections.abc import Mapping

from tacdata.discrepancy.levels.lack_of_fit import CLEAR_GAIN, CLEAR_T, Lack, surely_elsewhere
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.effects import Family

LEFT_T = 2.0
"""Leftovers: they count from so many standard errors over episodes on [1]."""
SHARE_LEFT_ALONE = 0.15
"""Leftovers: largest share of the explainable that one effect may leave, of which every rival leaves twice as much."""


def stands_in(findings: Findings, finding: FoundEffect, lacking: Mapping[Family, Lack]) -> bool:
    """Return whether an effect may be model error of another, or part of the common remainder.

    Its own part is small compared with these. (A form that is wrong by a tenth leaves a hundredth of its explained
    part.) The part that an unnamed family explains counts as remainder. For a single effect, see `adequate`.
    """
    if len(findings.effects) < 2 or finding.corrected_p is None:
        return False
    if lent(findings, finding):
        return True
    further = finding.bought < max(f.bought for f in findings.effects if f.corrected_p is not None)
    if further and findings.left.gain >= max(finding.bought, CLEAR_GAIN) and findings.left.t >= CLEAR_T:
        return True  # more is left than it explains: less of that need be sure
    remainder = max(_left(findings), *(lacking[family].gain for family in surely_elsewhere(findings, lacking)), 0.0)
    return remainder > 0 and remainder >= SHARE_LEFT_ALONE * (remainder + max(finding.bought, 0.0))


def lent(findings: Findings, finding: FoundEffect) -> bool:
    """Return whether an effect explains no more than another's form may leave."""
    return finding.bought < form_error(findings)


def form_error(findings: Findings) -> float:
    """Return the model error of an effect's form: half a whitened sum of squares [1]."""
    raced = [f for f in findings.effects if f.corrected_p is not None]
    return max((f.placed.effect.form_error**2 * f.bought for f in raced), default=0.0)


def beside_open(findings: Findings, answer: list[FoundEffect], levels: list[Level | None]) -> list[Level | None]:
    """Return the levels that hold while other effects of the answer are open: these count as left over, too.

    The effect that explains most has a name, whatever else of the answer may be something else.
    """
    remainder = _left(findings) + sum(
        max(f.bought, 0.0) for f, level in zip(answer, levels, strict=True) if level is None
    )
    large = [remainder < SHARE_LEFT_ALONE * (remainder + max(f.bought, 0.0)) for f in answer]
    return [level if clear else None for level, clear in zip(levels, large, strict=True)]


def _left(findings: Findings) -> float:
    """Return the certain part of the residual [half the whitened sum of squares, held out]."""
    return findings.left.gain if findings.left.t >= LEFT_T else 0.0
