"""The decision: named, ambiguous, unknown or none. Every status is given here, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum, auto

from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.search.elimination import LARGEST_P
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.gate import GATE
from tacdata.discrepancy.verdict.calibration import calibration_error, gains_beyond_calibration
from tacdata.discrepancy.verdict.confidence import confidence, features
from tacdata.effects import load

SHARE_LEFT = 0.05
"""Leftovers: largest share of the explainable that an answer may leave [1]."""
SHARE_LEFT_ALONE = 0.15
"""Leftovers: the same for a single effect of which every rival leaves twice as much [1]."""
LEFT_T = 2.0
"""Leftovers: they count from so many standard errors over episodes on [1]."""
GAP_T = 3.0
"""Leftovers: without any effect that helps, they are a gap from so many standard errors on [1]."""
SETTLED_Z = 5.0
"""J test: a rival beaten by so many standard errors is out, whatever the answer leaves [1]."""
LOUD = 2.0
"""Residual: a mean square of so many noise floors is unknown, not none, even if no test rejects [1]."""
RARE_P = 0.003
"""Score test: with so small a corrected p-value `NEEDED_Z` standard errors of necessity are enough [1]."""


class Reason(Enum):
    """Why a status was given."""

    CONTRADICTION = auto()
    """The recordings contradict the model's wiring, or units."""
    TOO_FEW = auto()
    """Too few episodes."""
    STOPPED = auto()
    """Stopped before the last step."""
    QUIET = auto()
    """Nothing is missing that these recordings would show."""
    NAMED = auto()
    """Nothing else explains the episodes as well."""
    RIVALS = auto()
    """Others explain the episodes as well, or the effect is not surely needed."""
    LEFTOVERS = auto()
    """The best answer leaves too much."""
    ODD = auto()
    """Some episodes are unlike all others, and no effect explains them."""
    LOUD = auto()
    """The residual is far above the noise, but no effect is supported by several episodes."""
    UNEXPLAINED = auto()
    """A gap that no modelled effect explains."""


@dataclass(frozen=True)
class Decided:
    """One effect of the verdict with its status."""

    finding: FoundEffect
    """Its rivals include those that the recordings cannot tell from it."""
    status: str
    """named, ambiguous, or suspected where the verdict names nothing."""
    features: dict[str, float]
    """What the confidence rests on."""
    confidence: float | None
    """Probability that the name is right [1]; None where nothing is named."""


@dataclass(frozen=True)
class Decision:
    """What may be said."""

    status: str
    """named, ambiguous, unknown or none."""
    reason: Reason
    effects: tuple[Decided, ...] = field(default=())


def decide(found: Findings, checks: DataChecks) -> Decision:
    """Decide what may be said of findings.

    Args:
        found: What the search found.
        checks: What the recordings can carry.
    """
    answer = answer_of(found)
    status, reason = _status(found, answer)
    if checks.contradictions:
        status, reason = "unknown", Reason.CONTRADICTION
    elif checks.too_few:
        status, reason = "unknown", Reason.TOO_FEW
    return Decision(status, reason, tuple(_decided(f, status, found, len(answer)) for f in answer))


def _status(found: Findings, answer: list[FoundEffect]) -> tuple[str, Reason]:
    """Return what the statistics allow."""
    if found.until != "decide":
        return ("unknown" if found.gap else "none"), Reason.STOPPED
    # One test in a hundred rejects by chance: without an effect, leftovers must confirm the gap.
    chance = found.tests.p_generic > GATE and found.left.t < GAP_T
    if not answer and (not found.gap or chance):
        if len(found.problem.null.odd):
            return "unknown", Reason.ODD
        if found.loudness > LOUD:
            return "unknown", Reason.UNEXPLAINED if found.gap else Reason.LOUD
        return "none", Reason.QUIET
    if not answer:
        return "unknown", Reason.ODD if len(found.problem.null.odd) else Reason.UNEXPLAINED
    if not adequate(found, answer):
        return "unknown", Reason.LEFTOVERS
    if any(settled(f) != "named" for f in answer):
        return "ambiguous", Reason.RIVALS
    return "named", Reason.NAMED


def answer_of(found: Findings) -> list[FoundEffect]:
    """Return the effects of the answer, with all their rivals, and those that calibration shows."""
    course, own = found.problem.setting.course, []
    for f in found.effects:
        effect = f.placed.effect
        rivals = [*f.rivals, *lookalikes(course, effect, f.placed.values), *_hidden(found, f)]
        own.append(replace(f, rivals=tuple(name for name in dict.fromkeys(rivals) if name != effect.called)))
    return [*(f for f in own if not calibration_error(f)), *gains_beyond_calibration(found)]


def adequate(found: Findings, answer: list[FoundEffect]) -> bool:
    """Return whether nothing much is left to explain.

    Real effects have other forms than any library. What a single effect leaves is its own form where every rival would
    leave twice as much, or more.
    """
    if found.left.t < LEFT_T or found.share_left < SHARE_LEFT:
        return True
    if len(answer) != 1 or settled(answer[0]) != "named" or found.share_left >= SHARE_LEFT_ALONE:
        return False
    return all(loss > found.left.gain for loss in answer[0].losses.values())


def settled(finding: FoundEffect) -> str:
    """Return whether one effect may be named: named or ambiguous."""
    needed = finding.necessity >= finding.needed
    if finding.corrected_p is not None:
        needed = finding.corrected_p <= (LARGEST_P if needed else RARE_P)
    return "named" if needed and not finding.rivals and not finding.at_bound else "ambiguous"


def _hidden(found: Findings, finding: FoundEffect) -> list[str]:
    """Return rivals that are worse by less than what the answer itself leaves: another form may turn them around."""
    if found.left.t < LEFT_T:
        return []
    near = [name for name, loss in finding.losses.items() if loss < found.left.gain]
    return [load(name).called for name in near if finding.margins[name] < SETTLED_Z]


def _decided(finding: FoundEffect, verdict: str, found: Findings, count: int) -> Decided:
    """Return an effect with its status; whoever reads it alone must not take it for a name that the verdict refuses."""
    status = "suspected" if verdict == "unknown" else settled(finding)
    values = features(found, finding, count)
    return Decided(finding, status, values, confidence(values) if status == "named" else None)
