"""The decision: one of five statuses. Every status is given here, and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.levels.lack_of_fit import SHARE_LEFT, Lack, another_form, elsewhere, fills
from tacdata.discrepancy.levels.margins import BesideRemainder, Level
from tacdata.discrepancy.levels.several_names import LEFT_T, SHARE_LEFT_ALONE, beside_open, lent, stands_in, traded
from tacdata.discrepancy.search.elimination import LARGEST_P
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.search.gate import GATE
from tacdata.discrepancy.search.leftovers import Leftovers
from tacdata.discrepancy.search.shortlist import RIVAL_Z
from tacdata.discrepancy.verdict.calibration import calibration_error, compliance_of_specimens, gains_beyond_calibration
from tacdata.discrepancy.verdict.confidence import confidence, features
from tacdata.discrepancy.verdict.lone_press import LonePress, lone_press
from tacdata.discrepancy.verdict.sealed import Gap, borne_out, refuted
from tacdata.effects import AtRest, Family, load

GAP_T = 3.0
"""Leftovers: without any effect that helps, they are a gap from so many standard errors on [1]."""
SAME_SIZE = 0.1
"""Constancy: an effect whose size spreads by so little over all conditions is a mechanism, whatever is left [1]..."""
ALIKE_SIZE = 0.2
"""...and by so little it is surely of its family. Stand-ins spread by more, but for those that look the same [1]."""
FAR_SIZE = 0.25
"""Constancy: ... or by so little, where no rival is within `SETTLED_Z` and the sealed gap surely closes [1]."""
SURELY_CLOSED = 0.5
"""Sealed episodes: the gap surely closes if the 90 % interval of the share that is closed begins above this [1]."""
SETTLED_Z = 5.0
"""J test: a rival beaten by so many standard errors is out, whatever the answer leaves [1]."""
LOUD = 2.0
"""Residual: a mean square of so many noise floors is unknown, not none, even if no test rejects [1]."""
RARE_P = 0.003
"""Score test: with so small a corrected p-value `NEEDED_Z` standard errors of necessity are enough [1]."""
INCOMPLETE = "named, incomplete"
"""Status: some of what is missing has a name, the rest has not."""


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
    INCOMPLETE = auto()
    """Some of it has a name, at some level, beside a remainder that has none."""
    LEFTOVERS = auto()
    """The best answer leaves too much."""
    ODD = auto()
    """Some episodes are unlike all others, and no effect explains them."""
    ALARM = auto()
    """No effect shows, but the residual is not noise: it has no form of the library."""
    LOUD = auto()
    """The residual is far above the noise, but no effect is supported by several episodes."""
    SEALED = auto()
    """The sealed episodes, which should show it, do not bear the answer out."""
    UNEXPLAINED = auto()
    """A gap that no modelled effect explains."""


@dataclass(frozen=True)
class Decided:
    """One effect of the verdict with its status."""

    finding: FoundEffect
    """Its rivals include those that the recordings cannot tell from it."""
    status: str
    """named, ambiguous, or suspected where the verdict does not name it."""
    features: dict[str, float]
    """What the confidence rests on."""
    confidence: float | None
    """Probability that the name is right [1]; None where nothing is named."""
    level: Level | None = None
    """The finest level at which it is named; None where it is not."""
    beside: BesideRemainder | None = None
    """Its evidence beside a remainder, where something is left."""


@dataclass(frozen=True)
class Decision:
    """What may be said."""

    status: str
    """named, "named, incomplete", ambiguous, unknown or none."""
    reason: Reason
    effects: tuple[Decided, ...] = field(default=())
    lone: LonePress | None = None
    """What one press alone shows, where nothing else has a name."""
    lacking: Mapping[Family, Lack] = field(default_factory=dict)
    """What each family's saturated model still explains."""
    alarms: tuple[Alarm, ...] = ()
    """What the residual shows without a form."""

    @property
    def surest_first(self) -> list[Decided]:
        """The effects in the order in which a reader meets them: named, ambiguous, suspected."""
        return sorted(self.effects, key=lambda e: ("named", "ambiguous", "suspected").index(e.status))


def decide(
    found: Findings,
    checks: DataChecks,
    beside: tuple[BesideRemainder, ...] = (),
    shown: Gap | None = None,
    lacking: Mapping[Family, Lack] | None = None,
    seen: tuple[Alarm, ...] = (),
) -> Decision:
    """Decide what may be said of findings.

    Args:
        found: What the search found.
        checks: What the recordings can carry.
        beside: The evidence of each effect that was found beside a remainder, where something is left.
        shown: The gap on sealed episodes: it can take a name away, and never gives one.
        lacking: What each family's saturated model explains beside the answer.
        seen: What the residual shows without a form: where no effect shows, it is no reassurance.
    """
    lacking = lacking or {}
    answer = answer_of(found)
    status, reason = _status(found, answer)
    if reason is Reason.QUIET and (given := compliance_of_specimens(found)):
        answer, status, reason = given, "ambiguous", Reason.RIVALS
    if reason is Reason.QUIET and seen:
        status, reason = "unknown", Reason.ALARM
    own = {f.placed.effect.name: b for f, b in zip(found.effects, beside, strict=False)}
    levels = [finest(f) for f in answer]
    sealed = shown is not None and bool(len(shown.names))
    if reason is Reason.LEFTOVERS and not refuted(shown) and (borne_out(shown) or not sealed):
        first = leading(answer)
        levels = [beside_much(found, f, own.get(f.placed.effect.name), shown) for f in answer]
        if first is None or levels[first] is None:
            levels = [None for _ in answer]
        if not any(levels) and first is not None and fills(found, answer[first], lacking):
            # What is left is another law of its family: at that level nothing is, and no rival hides in it.
            answer[first] = answer_of(replace(found, left=Leftovers(0.0, 0.0)))[first]
            levels[first] = finest(answer[first]) and Level.FAMILY
        if any(levels):
            status, reason = INCOMPLETE, Reason.INCOMPLETE
        elif first is not None and stands(found, answer[first], own.get(answer[first].placed.effect.name), shown):
            status, reason = "ambiguous", Reason.RIVALS
    if reason is Reason.RIVALS:
        sure = beside_open(found, answer, levels)
        if any(sure) and not all(sure):
            levels, status, reason = sure, INCOMPLETE, Reason.INCOMPLETE
    if status == "named" and lends_form(found, answer):
        levels, status, reason = [Level.FAMILY], INCOMPLETE, Reason.INCOMPLETE
    early = [seems_early(f, answer) for f in answer]
    asked = [status == "named" or k != leading(answer) for k in range(len(answer))]
    parts = [ask and stands_in(found, f, lacking) for ask, f in zip(asked, answer, strict=True)]
    open_ones = [e or part for e, part in zip(early, parts, strict=True)]
    if status in ("named", INCOMPLETE) and any(open_ones):
        # One of several names may stand in for a part of what has none: only the others are sure.
        levels = [None if doubt else level for doubt, level in zip(open_ones, levels, strict=True)]
        status, reason = (INCOMPLETE, Reason.INCOMPLETE) if any(levels) else ("ambiguous", Reason.RIVALS)
    rough = [level is not None and another_form(f, lacking) for f, level in zip(answer, levels, strict=True)]
    # Another law of the family is there, too, or in its place: the family alone is sure.
    levels = [Level.FAMILY if own else level for own, level in zip(rough, levels, strict=True)]
    if status in ("named", INCOMPLETE) and (any(rough) or elsewhere(found, lacking)):
        status, reason = INCOMPLETE, Reason.INCOMPLETE
    if any(trades := traded(answer, levels)):
        levels = [None if trade else level for trade, level in zip(trades, levels, strict=True)]
        if status in ("named", INCOMPLETE):
            status, reason = (INCOMPLETE, Reason.INCOMPLETE) if any(levels) else ("ambiguous", Reason.RIVALS)
    if status in ("named", INCOMPLETE) and refuted(shown):
        status, reason = "unknown", Reason.SEALED
    if status in ("named", INCOMPLETE) and not borne_out(shown):
        # Behind a closed gate, sealed episodes alone show a gain. A name whose sealed interval holds zero is suspected.
        unshown = shown is not None and sealed and shown.interval[0] <= 0
        if unshown or (status == "named" and not found.gap):
            levels, status, reason = [None for _ in answer], "ambiguous", Reason.RIVALS
    if checks.contradictions:
        status, reason = "unknown", Reason.CONTRADICTION
    elif checks.too_few:
        status, reason = "unknown", Reason.TOO_FEW
    made = zip(answer, levels, strict=True)
    lone = lone_press(found.given) if reason in (Reason.LOUD, Reason.ODD, Reason.UNEXPLAINED) else None
    return Decision(
        status,
        reason,
        tuple(
            _decided(f, status, found, len(answer), level, own.get(f.placed.effect.name), shown) for f, level in made
        ),
        lone,
        lacking,
        seen,
    )


def _of_one_family(finding: FoundEffect) -> bool:
    """Return whether all that would do as well is of its family."""
    return all(load(name).family is finding.placed.effect.family for name in finding.rivals)


def _within_bounds(finding: FoundEffect) -> FoundEffect:
    """Return an effect without the rivals that need an unphysical size: a remainder lends them what they explain."""
    return replace(finding, rivals=tuple(name for name in finding.rivals if name not in finding.unphysical))


def lends_form(found: Findings, answer: list[FoundEffect]) -> bool:
    """Return whether what a single lag leaves may lend it its form: only the edge's tells a filter from a delay."""
    if len(answer) != 1 or found.left.t < LEFT_T or found.share_left < SHARE_LEFT:
        return False
    effect = answer[0].placed.effect
    return effect.at_rest is AtRest.CATCHES_UP and effect.family is Family.DELAY_AND_FILTER


def seems_early(finding: FoundEffect, answer: list[FoundEffect]) -> bool:
    """Return whether readings come early beside a skin with memory: a sensor cannot, but what relaxes seems to.

    It is another form of the memory before it is an error of clocks.
    """
    memory = any(f.placed.effect.family is Family.SKIN_MEMORY for f in answer)
    return memory and finding.placed.effect.delay(finding.placed.values) < 0


def finest(finding: FoundEffect) -> Level | None:
    """Return the finest level at which an effect may be named; None if none holds.

    A shape at its bound leaves the family: the form is another one.
    """
    if not _needed(finding) or _unphysical(finding) or not _of_one_family(finding):
        return None
    if finding.rivals or finding.at_bound:
        return Level.FAMILY
    return Level.MECHANISM if any(by < RIVAL_Z for by in finding.forms.values()) else Level.FORM


def leading(answer: list[FoundEffect]) -> int | None:
    """Return which effect explains most beyond the others; what does not race has no such figure."""
    raced = [k for k, f in enumerate(answer) if f.corrected_p is not None]
    return max(raced, key=lambda k: answer[k].bought, default=None)


def stands(found: Findings, finding: FoundEffect, beside: BesideRemainder | None, shown: Gap | None = None) -> bool:
    """Return whether an effect, or one that looks the same, is there beside much that has no name.

    It is needed and explains more than is left, or surely most of the sealed gap. Its size is the same in all
    conditions: what it stands beside has no reason to follow it there.
    """
    if beside is None or not beside.spreads or not _needed(finding) or _unphysical(finding):
        return False
    closes = shown is not None and shown.interval[0] >= SURELY_CLOSED and bool(len(shown.names))
    far = closes and all(by >= SETTLED_Z for by in finding.margins.values())
    most = FAR_SIZE if far else ALIKE_SIZE
    return (closes or finding.bought >= found.left.gain) and max(beside.spreads.values()) <= most


def beside_much(
    found: Findings, finding: FoundEffect, beside: BesideRemainder | None, shown: Gap | None = None
) -> Level | None:
    """Return the finest level of an effect beside much that has no name; None if none holds.

    How exactly its size is the same in all conditions says how fine the name may be.
    """
    bare = _within_bounds(finding)
    level = finest(bare)
    if level is not None and bare.rivals != finding.rivals:
        level = Level.FAMILY
    if level is None or beside is None or not stands(found, finding, beside, shown):
        return None
    same = max(beside.spreads.values()) <= SAME_SIZE
    fine = level is not Level.FAMILY and same and not _untried_kin(found, finding)
    return Level.MECHANISM if fine else Level.FAMILY


def _unphysical(finding: FoundEffect) -> bool:
    """Return whether an amplitude is at its bound. A shape at its own says that the form is another one."""
    shapes = {p.name for p in finding.placed.effect.shapes}
    return bool(set(finding.at_bound) - shapes)


def _untried_kin(found: Findings, finding: FoundEffect) -> set[str]:
    """Return mechanisms of its group that do the same at rest, and were not held against it.

    They look alike but for their exact form, and what is left may lend it.
    """
    mine, tried = finding.placed.effect, {load(name).called for name in finding.margins}
    every = {c.effect.called: c.effect for c in found.given.candidates}
    kin = {
        called
        for called, e in every.items()
        if mine.at_rest is not None and (e.family, e.group, e.at_rest) == (mine.family, mine.group, mine.at_rest)
    }
    return kin - tried - {mine.called}


def _needed(finding: FoundEffect) -> bool:
    """Return whether an effect is surely there."""
    needed = finding.necessity >= finding.needed
    if finding.corrected_p is not None:
        needed = finding.corrected_p <= (LARGEST_P if needed else RARE_P)
    return needed


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
        alike = lookalikes(course, effect, f.placed.values)
        rivals = [name for name in dict.fromkeys([*f.rivals, *alike, *_hidden(found, f)]) if name != effect.called]
        # A size says nothing against what these presses cannot split.
        unphysical = tuple(name for name in f.unphysical if name in rivals and name not in alike)
        own.append(replace(f, rivals=tuple(rivals), unphysical=unphysical))
    # What is within another's form, and only where its own equation ends, is no sign of more.
    own = [f for f in own if not (f.at_bound and lent(found, f))]
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
    return "named" if _needed(finding) and not finding.rivals and not finding.at_bound else "ambiguous"


def _hidden(found: Findings, finding: FoundEffect) -> list[str]:
    """Return rivals that are worse by less than what the answer itself leaves: another form may turn them around."""
    if found.left.t < LEFT_T:
        return []
    near = [name for name, loss in finding.losses.items() if loss < found.left.gain]
    return [load(name).called for name in near if finding.margins[name] < SETTLED_Z]


def _decided(
    finding: FoundEffect,
    verdict: str,
    found: Findings,
    count: int,
    level: Level | None,
    beside: BesideRemainder | None,
    shown: Gap | None,
) -> Decided:
    """Return an effect with its status; whoever reads it alone must not take it for a name that the verdict refuses."""
    values = features(found, finding, count)
    if level is not None and not _of_one_family(finding):
        finding = _within_bounds(finding)
    if verdict == INCOMPLETE:
        return Decided(finding, "suspected" if level is None else "named", values, None, level, beside)
    status = "suspected" if verdict == "unknown" else settled(finding) if level is not None else "ambiguous"
    if beside is not None and not stands(found, finding, beside, shown):
        status = "suspected"
    sure = confidence(values) if status == "named" else None
    return Decided(finding, status, values, sure, None if status == "suspected" else level, beside)
