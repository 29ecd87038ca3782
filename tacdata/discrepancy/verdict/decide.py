"""The decision: one of five statuses. No other module gives a status."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.levels.lack_of_fit import SHARE_LEFT, Lack, another_form, elsewhere
from tacdata.discrepancy.levels.margins import BesideRemainder, Level
from tacdata.discrepancy.levels.several_names import LEFT_T, SHARE_LEFT_ALONE, beside_open, stands_in
from tacdata.discrepancy.search.elimination import LARGEST_P
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.gate import GATE
from tacdata.discrepancy.search.shortlist import RIVAL_Z
from tacdata.discrepancy.verdict.calibration import calibration_error, compliance_of_specimens, gains_beyond_calibration
from tacdata.discrepancy.verdict.confidence import confidence, features
from tacdata.discrepancy.verdict.lone_press import LonePress, lone_press
from tacdata.discrepancy.verdict.sealed import Gap, borne_out, refuted
from tacdata.effects import Family, load

GAP_T = 3.0
"""Leftovers: if no effect helps, they are a gap from so many standard errors on [1]."""
SAME_SIZE = 0.1
"""Constancy: largest spread of size over conditions at which a mechanism is named despite a remainder [1]..."""
ALIKE_SIZE = 0.2
"""...and largest spread for a family. Wrong effects spread by more, except collinear ones [1]."""
SURELY_CLOSED = 0.5
"""Sealed episodes: the gap surely closes if the 90 % interval of the share that is closed begins above this [1]."""
SETTLED_Z = 5.0
"""J test: margin from which a rival is excluded, however much the answer leaves unexplained [standard errors]."""
LOUD = 2.0
"""Residual: mean square from which the status is unknown, not none, even if no test rejects [noise floor]."""
RARE_P = 0.003
"""Score test: with so small a corrected p-value, a necessity of `NEEDED_Z` suffices for a name [1]."""
INCOMPLETE = "named, incomplete"
"""Status: part of the gap is named, another part is unexplained."""


class Reason(Enum):
    """Why a status was given."""

    CONTRADICTION = auto()
    """The recordings contradict the model's wiring, or units."""
    TOO_FEW = auto()
    """Too few episodes."""
    STOPPED = auto()
    """Stopped before the last step."""
    QUIET = auto()
    """No effect is missing within the detection limits of these recordings."""
    NAMED = auto()
    """No rival explains the episodes as well."""
    RIVALS = auto()
    """Rivals explain the episodes as well, or the necessity of the effect is not certain."""
    INCOMPLETE = auto()
    """Part of the gap is named, at some level; a remainder is unexplained."""
    LEFTOVERS = auto()
    """The best answer leaves too much unexplained."""
    ODD = auto()
    """Some episodes are unlike all others, and no effect explains them."""
    ALARM = auto()
    """No effect is significant, but an alarm shows structure in the residual outside the library."""
    LOUD = auto()
    """The residual is far above the noise, but no effect is supported by several episodes."""
    SEALED = auto()
    """The sealed episodes refute the answer, though they have the power to show it."""
    UNEXPLAINED = auto()
    """A gap that no modelled effect explains."""


@dataclass(frozen=True)
class Decided:
    """One effect of the verdict with its status."""

    finding: FoundEffect
    """The effect; its rivals include those that the recordings cannot distinguish from it."""
    status: str
    """named, ambiguous, or suspected where the verdict does not name it."""
    features: dict[str, float]
    """Input of the confidence, by name [1]."""
    confidence: float | None
    """Probability that the name is right [1]; None where nothing is named."""
    level: Level | None = None
    """The finest level at which it is named; None where it is not."""
    beside: BesideRemainder | None = None
    """Its evidence given a remainder; None where there is no remainder."""


@dataclass(frozen=True)
class Decision:
    """Status of a verdict, its reason, and the status of each effect."""

    status: str
    """named, "named, incomplete", ambiguous, unknown or none."""
    reason: Reason
    effects: tuple[Decided, ...] = field(default=())
    lone: LonePress | None = None
    """An effect that only one press shows, where none is named."""
    lacking: Mapping[Family, Lack] = field(default_factory=dict)
    """Lack of fit: the part of the residual that each family's saturated model explains."""
    alarms: tuple[Alarm, ...] = ()
    """Structure of the residual outside the library."""

    @property
    def surest_first(self) -> list[Decided]:
        """The effects in reading order: named, ambiguous, suspected."""
        return sorted(self.effects, key=lambda e: ("named", "ambiguous", "suspected").index(e.status))


def decide(
    findings: Findings,
    checks: DataChecks,
    evidence: tuple[BesideRemainder, ...] = (),
    gap: Gap | None = None,
    lacking: Mapping[Family, Lack] | None = None,
    raised: tuple[Alarm, ...] = (),
) -> Decision:
    """Decide the status of findings.

    Args:
        findings: Findings of the search.
        checks: Limits and contradictions of the recordings.
        evidence: Evidence of each effect found, given a remainder; empty where there is no remainder.
        gap: Gap on sealed episodes. It can withdraw a name, never give one.
        lacking: Lack of fit: the part of the answer's residual that each family's saturated model explains.
        raised: Alarms. They turn the status none into unknown.
    """
    lacking = lacking or {}
    answer = answer_of(findings)
    status, reason = _status(findings, answer)
    if reason is Reason.QUIET and (specimen_effects := compliance_of_specimens(findings)):
        answer, status, reason = specimen_effects, "ambiguous", Reason.RIVALS
    if reason is Reason.QUIET and raised:
        status, reason = "unknown", Reason.ALARM
    evidence_of = {f.placed.effect.name: b for f, b in zip(findings.effects, evidence, strict=False)}
    levels = [finest(f) for f in answer]
    sealed = gap is not None and bool(len(gap.names))
    if reason is Reason.LEFTOVERS and not refuted(gap) and (borne_out(gap) or not sealed):
        first = leading(answer)
        levels = [beside_much(findings, f, evidence_of.get(f.placed.effect.name), gap) for f in answer]
        if first is None or levels[first] is None:
            levels = [None for _ in answer]
        if any(levels):
            status, reason = INCOMPLETE, Reason.INCOMPLETE
        elif first is not None and stands(
            findings, answer[first], evidence_of.get(answer[first].placed.effect.name), gap
        ):
            status, reason = "ambiguous", Reason.RIVALS
    if reason is Reason.RIVALS:
        clear_levels = beside_open(findings, answer, levels)
        if any(clear_levels) and not all(clear_levels):
            levels, status, reason = clear_levels, INCOMPLETE, Reason.INCOMPLETE
    early_effects = [seems_early(f, answer) for f in answer]
    candidates = [status == "named" or k != leading(answer) for k in range(len(answer))]
    parts = [ask and stands_in(findings, f, lacking) for ask, f in zip(candidates, answer, strict=True)]
    open_ones = [e or part for e, part in zip(early_effects, parts, strict=True)]
    if status in ("named", INCOMPLETE) and any(open_ones):
        # One of several names may be a form of the unexplained part: only the other names are certain.
        levels = [None if doubt else level for doubt, level in zip(open_ones, levels, strict=True)]
        status, reason = (INCOMPLETE, Reason.INCOMPLETE) if any(levels) else ("ambiguous", Reason.RIVALS)
    doubtful_forms = [level is not None and another_form(f, lacking) for f, level in zip(answer, levels, strict=True)]
    # Another law of the family is present, too, or is the true one: only the family is certain.
    levels = [Level.FAMILY if doubt else level for doubt, level in zip(doubtful_forms, levels, strict=True)]
    if status in ("named", INCOMPLETE) and (any(doubtful_forms) or elsewhere(findings, lacking)):
        status, reason = INCOMPLETE, Reason.INCOMPLETE
    if status in ("named", INCOMPLETE) and refuted(gap):
        status, reason = "unknown", Reason.SEALED
    if status in ("named", INCOMPLETE) and not borne_out(gap):
        # Behind a closed gate, sealed episodes alone show a gain. A name whose sealed interval holds zero is suspected.
        unshown = gap is not None and sealed and gap.interval[0] <= 0
        if unshown or (status == "named" and not findings.gap):
            levels, status, reason = [None for _ in answer], "ambiguous", Reason.RIVALS
    if checks.contradictions:
        status, reason = "unknown", Reason.CONTRADICTION
    elif checks.too_few:
        status, reason = "unknown", Reason.TOO_FEW
    lone = lone_press(findings.given) if reason in (Reason.LOUD, Reason.ODD, Reason.UNEXPLAINED) else None
    decided = [
        _decided(f, status, findings, len(answer), level, evidence_of.get(f.placed.effect.name), gap)
        for f, level in zip(answer, levels, strict=True)
    ]
    return Decision(status, reason, tuple(decided), lone, lacking, raised)


def _of_one_family(finding: FoundEffect) -> bool:
    """Return whether all rivals of an effect are of its family."""
    return all(load(name).family is finding.placed.effect.family for name in finding.rivals)


def _within_bounds(finding: FoundEffect) -> FoundEffect:
    """Return an effect without rivals that need an unphysical size: these only fit part of the remainder."""
    return replace(finding, rivals=tuple(name for name in finding.rivals if name not in finding.unphysical))


def seems_early(finding: FoundEffect, answer: list[FoundEffect]) -> bool:
    """Return whether a negative delay is found together with memory of the skin.

    No sensor reads ahead, but a relaxing skin seems to. The delay is then more likely another form of the memory
    than an error of clocks.
    """
    memory = any(f.placed.effect.family is Family.SKIN_MEMORY for f in answer)
    return memory and finding.placed.effect.delay(finding.placed.values) < 0


def finest(finding: FoundEffect) -> Level | None:
    """Return the finest level at which an effect may be named; None if none holds.

    With a shape at its bound only the family is named: the form is another one.
    """
    if not _needed(finding) or _unphysical(finding) or not _of_one_family(finding):
        return None
    if finding.rivals or finding.at_bound:
        return Level.FAMILY
    return Level.MECHANISM if any(by < RIVAL_Z for by in finding.forms.values()) else Level.FORM


def leading(answer: list[FoundEffect]) -> int | None:
    """Return the index of the effect that explains most beyond the others, of those from the search; None without any.

    Effects from calibration have no such figure.
    """
    raced = [k for k, f in enumerate(answer) if f.corrected_p is not None]
    return max(raced, key=lambda k: answer[k].bought, default=None)


def stands(findings: Findings, finding: FoundEffect, evidence: BesideRemainder | None, gap: Gap | None = None) -> bool:
    """Return whether an effect, or one collinear with it, is present although much is unexplained.

    It is needed, and explains more than the remainder or certainly most of the sealed gap. Its size is the same in
    all conditions: a remainder has no reason to follow it into each of them.
    """
    if evidence is None or not evidence.spreads or not _needed(finding) or _unphysical(finding):
        return False
    closes = gap is not None and gap.interval[0] >= SURELY_CLOSED and bool(len(gap.names))
    return (closes or finding.bought >= findings.left.gain) and max(evidence.spreads.values()) <= ALIKE_SIZE


def beside_much(
    findings: Findings, finding: FoundEffect, evidence: BesideRemainder | None, gap: Gap | None = None
) -> Level | None:
    """Return the finest level of an effect although much is unexplained; None if none holds.

    The more exactly its size is the same in all conditions, the finer is the level.
    """
    bare = _within_bounds(finding)
    level = finest(bare)
    if level is not None and bare.rivals != finding.rivals:
        level = Level.FAMILY
    if level is None or evidence is None or not stands(findings, finding, evidence, gap):
        return None
    same = max(evidence.spreads.values()) <= SAME_SIZE
    fine = level is not Level.FAMILY and same
    return Level.MECHANISM if fine else Level.FAMILY


def _unphysical(finding: FoundEffect) -> bool:
    """Return whether an amplitude is at its bound; a shape at its bound only means that the form is another one."""
    shapes = {p.name for p in finding.placed.effect.shapes}
    return bool(set(finding.at_bound) - shapes)


def _needed(finding: FoundEffect) -> bool:
    """Return whether an effect is significant: necessity, and the corrected p-value where the search gave one."""
    needed = finding.necessity >= finding.needed
    if finding.corrected_p is not None:
        needed = finding.corrected_p <= (LARGEST_P if needed else RARE_P)
    return needed


def _status(findings: Findings, answer: list[FoundEffect]) -> tuple[str, Reason]:
    """Return status and reason by the tests of the search alone."""
    if findings.until != "decide":
        return ("unknown" if findings.gap else "none"), Reason.STOPPED
    # One test in a hundred rejects by chance: without an effect, leftovers must confirm the gap.
    chance = findings.tests.p_generic > GATE and findings.left.t < GAP_T
    if not answer and (not findings.gap or chance):
        if len(findings.problem.null.odd):
            return "unknown", Reason.ODD
        if findings.loudness > LOUD:
            return "unknown", Reason.UNEXPLAINED if findings.gap else Reason.LOUD
        return "none", Reason.QUIET
    if not answer:
        return "unknown", Reason.ODD if len(findings.problem.null.odd) else Reason.UNEXPLAINED
    if not adequate(findings, answer):
        return "unknown", Reason.LEFTOVERS
    if any(settled(f) != "named" for f in answer):
        return "ambiguous", Reason.RIVALS
    return "named", Reason.NAMED


def answer_of(findings: Findings) -> list[FoundEffect]:
    """Return the effects of the answer with all their rivals, and the gains beyond calibration."""
    course, effects = findings.problem.setting.course, []
    for f in findings.effects:
        effect = f.placed.effect
        alike = lookalikes(course, effect, f.placed.values)
        rivals = [name for name in dict.fromkeys([*f.rivals, *alike, *_hidden(findings, f)]) if name != effect.called]
        # An unphysical size is no argument against a rival that these presses cannot distinguish.
        unphysical = tuple(name for name in f.unphysical if name in rivals and name not in alike)
        effects.append(replace(f, rivals=tuple(rivals), unphysical=unphysical))
    return [*(f for f in effects if not calibration_error(f)), *gains_beyond_calibration(findings)]


def adequate(findings: Findings, answer: list[FoundEffect]) -> bool:
    """Return whether the answer leaves little to explain.

    Real effects differ in form from any library. The residual of a single effect is its model error if every rival
    would leave at least twice as much.
    """
    if findings.left.t < LEFT_T or findings.share_left < SHARE_LEFT:
        return True
    if len(answer) != 1 or settled(answer[0]) != "named" or findings.share_left >= SHARE_LEFT_ALONE:
        return False
    return all(loss > findings.left.gain for loss in answer[0].losses.values())


def settled(finding: FoundEffect) -> str:
    """Return whether one effect may be named: named or ambiguous."""
    return "named" if _needed(finding) and not finding.rivals and not finding.at_bound else "ambiguous"


def _hidden(findings: Findings, finding: FoundEffect) -> list[str]:
    """Return rivals that lose less than the answer leaves: in another form they might win."""
    if findings.left.t < LEFT_T:
        return []
    near = [name for name, loss in finding.losses.items() if loss < findings.left.gain]
    return [load(name).called for name in near if finding.margins[name] < SETTLED_Z]


def _decided(
    finding: FoundEffect,
    verdict: str,
    findings: Findings,
    count: int,
    level: Level | None,
    evidence: BesideRemainder | None,
    gap: Gap | None,
) -> Decided:
    """Return an effect with its status: never named where the verdict gives no name, so it can be read alone."""
    values = features(findings, finding, count)
    if level is not None and not _of_one_family(finding):
        finding = _within_bounds(finding)
    if verdict == INCOMPLETE:
        return Decided(finding, "suspected" if level is None else "named", values, None, level, evidence)
    status = "suspected" if verdict == "unknown" else settled(finding) if level is not None else "ambiguous"
    if evidence is not None and not stands(findings, finding, evidence, gap):
        status = "suspected"
    probability = confidence(values) if status == "named" else None
    return Decided(finding, status, values, probability, None if status == "suspected" else level, evidence)
