"""The verdict in a sentence. It decides nothing: status and reason come from `decide.py`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.levels.lack_of_fit import another_form, elsewhere, of_family
from tacdata.discrepancy.levels.margins import Level
from tacdata.discrepancy.levels.several_names import LEFT_T, SHARE_LEFT_ALONE
from tacdata.discrepancy.plain_number import plain_number
from tacdata.discrepancy.search.findings import Findings, FoundEffect
from tacdata.discrepancy.verdict.decide import Decided, Decision, Reason
from tacdata.discrepancy.verdict.sealed import Gap, borne_out
from tacdata.discrepancy.verdict.text import LEAST_CLOSED, worsened
from tacdata.effects import Family, load

SPEAKS_FROM = 0.005
"""Least unexplained share that the sentence mentions [1]."""
SMALL = 0.01
"""Change of the residual of sealed presses below which effects are called small [1]."""
ALL_CLOSED = 0.995
"""Closed share of the gap that counts as all of it: it would be printed as 100 % [1]."""
SIGNS = {
    Family.DRIFT: "gains that each part of the sensor changes by itself",
    Family.KINEMATICS: "depths and places that go with place, side, order or direction",
    Family.CONTACT: "depths and places that go with place, side, order or direction",
    Family.SKIN_MEMORY: "readings that follow by other times, or come back",
    Family.FRICTION_AND_PLAY: "loading against unloading",
    Family.DELAY_AND_FILTER: "readings that go with the rate",
    Family.RESPONSE_CURVE: "how readings grow with depth",
    Family.CROSSTALK: "what other channels read",
}
"""Where the residual shows another law of a family."""
MOST_LISTED = 6
"""Most episodes that are listed by name."""
MOST_STAND_INS = 3
"""Most rivals that are listed by name; of more, the families are listed."""


def reason_in_words(decision: Decision, findings: Findings, checks: DataChecks, gap: Gap | None = None) -> str:
    """Return the verdict in a sentence.

    Args:
        decision: Status and reason.
        findings: Findings of the search.
        checks: Limits and contradictions of the recordings.
        gap: Gap on the sealed episodes.
    """
    answer = [e.finding for e in decision.effects]
    names = _listed([f.placed.effect.spoken for f in answer], "and") if answer else ""
    match decision.reason:
        case Reason.CONTRADICTION:
            return "; ".join(checks.contradictions)
        case Reason.TOO_FEW:
            best = f"; the best fit so far: {_best(decision.effects)}" if answer else ""
            return f"{checks.episodes} presses are too few for a verdict{best}"
        case Reason.STOPPED:
            fits = f"; {names} {'fits' if len(answer) == 1 else 'fit'} best, rivals were not tried" if answer else ""
            return f"stopped after {findings.until}: {'a gap' if findings.gap else 'no gap'}{fits}"
        case Reason.QUIET:
            if checks.watched:
                return f"no effect of the library shows, but {'; '.join(checks.watched)}"
            if checks.base:
                return (
                    "no effect of time, rate or path shows; what depends on the pose alone, as stiffness and "
                    "compliance, cannot be judged without a model of the sensor"
                )
            return "nothing is missing that these recordings would show; see the detection limits"
        case Reason.NAMED:
            little = findings.left.t < LEFT_T or findings.share_left < SPEAKS_FROM
            law = "its law is" if len(answer) == 1 else "their laws are"
            more = "" if little else f". {100 * findings.share_left:.1f} % is left: {law} a little different"
            sentence = f"{_there(names, len(answer), decision, gap)}. Nothing else explains the presses as well"
            return sentence + _small(len(answer), gap) + more
        case Reason.RIVALS:
            return "".join((_undecided(decision, gap), _own_laws(decision), _nameless(findings, SHARE_LEFT_ALONE)))
        case Reason.INCOMPLETE:
            return _incomplete(decision, gap) + _other_laws(decision, findings) + _nameless(findings, 0.0)
        case Reason.SEALED:
            fits = f"{names} {'fits' if len(answer) == 1 else 'fit'} the presses that were judged"
            return f"{fits}; {_against(gap)}: not the name"
        case Reason.LEFTOVERS:
            closest = _closest(answer, findings.share_left, gap)
            return f"something is missing that has no name yet; {closest}{_elsewhere(decision, findings)}"
        case Reason.ODD:
            odd = _odd([findings.problem.setting.course.names[k] for k in findings.problem.null.odd])
            return odd + _lone(decision, findings, "; ")
        case Reason.ALARM:
            return f"no effect of the library shows, but {_seen(decision)}"
        case Reason.LOUD:
            loud = f"{plain_number(findings.loudness, 2)} times the noise's"
            remark = f"the residual's mean square is {loud}, but no effect shows in several presses"
            return remark + (_lone(decision, findings, ": ") or ": look at where it lives")
        case Reason.UNEXPLAINED:
            evidence = f": {_seen(decision)}" if decision.alarms else ""
            return "something is missing that no modelled effect explains" + evidence + _lone(decision, findings, "; ")


def _seen(decision: Decision) -> str:
    """Return the findings of all alarms."""
    return "; ".join(alarm.seen for alarm in decision.alarms)


def _against(gap: Gap | None) -> str:
    """Return the evidence of sealed episodes against an answer as a clause."""
    if gap is None or gap.ratio is None:
        return "the sealed presses do not bear it out"
    share, error = 100 * gap.ratio.share, 100 * gap.ratio.error
    return f"the sealed presses do not bear it out (they show {share:.0f} % of it, standard error {error:.0f} %)"


def _lone(decision: Decision, findings: Findings, lead: str) -> str:
    """Return a clause on an effect that only one press shows; empty where there is none."""
    if (lone := decision.lone) is None:
        return ""
    press = findings.problem.setting.course.names[lone.episode]
    return (
        f"{lead}{lone.effect.spoken} would explain {100 * lone.share:.0f} % of it, but {press} alone holds "
        f"{100 * lone.leverage:.0f} % of what shows it, and one press carries no name"
    )


def _incomplete(decision: Decision, gap: Gap | None) -> str:
    """Return the named effects with their level and the share of the gap that they close, then the suspected ones."""
    named = [e for e in decision.effects if e.level is not None]
    words = _all_called(named)
    open_ones = list(dict.fromkeys(e.finding.placed.effect.spoken for e in decision.effects if e.level is None))
    sentence = _there(_listed(words, "and"), len(words), decision, gap)
    return sentence + (f"; {_listed(open_ones, 'and')} may be there, too" if open_ones else "")


def _there(names: str, count: int, decision: Decision, gap: Gap | None) -> str:
    """Return a clause on the presence of effects, with the share of the sealed gap that they close."""
    clause, closed = f"{names} {'is' if count == 1 else 'are'} there", _closed(decision, gap)
    return f"{clause} and {'closes' if count == 1 else 'close'} {closed}" if closed else clause


def _small(count: int, gap: Gap | None) -> str:
    """Return a remark on effects that hardly change the fit of sealed presses; empty for larger ones."""
    sealed = gap.document() if gap is not None and len(gap.before) else {}
    if not sealed or abs(sealed["after"] - sealed["before"]) > SMALL * sealed["before"]:
        return ""
    evidence = ", yet seen on sealed presses" if borne_out(gap) else ": sealed presses fit as well without"
    return f". {'It is' if count == 1 else 'They are'} small{evidence}"


def _other_laws(decision: Decision, findings: Findings) -> str:
    """Return clauses on the evidence for other laws: of a named family, then of an unnamed one."""
    return _own_laws(decision) + _elsewhere(decision, findings)


def _elsewhere(decision: Decision, findings: Findings) -> str:
    """Return a clause on the unnamed family that explains most; empty without one."""
    families = elsewhere(findings, decision.lacking)[:1]
    return "".join(f"; something of {family.value} shows, too, in {SIGNS[family]}" for family in families)


def _own_laws(decision: Decision) -> str:
    """Return clauses on the evidence for another law of a named family."""
    shares: dict[Family, float] = {}
    for e in decision.effects:
        family, lack = e.finding.placed.effect.family, of_family(e.finding, decision.lacking)
        if e.level is not None and lack is not None and another_form(e.finding, decision.lacking):
            shares[family] = min(100 * lack.size / max(e.finding.bought, 1e-9), shares.get(family, np.inf))
    return "".join(
        f"; another law of {family.value} would explain {share:.0f} % more, in {SIGNS[family]}"
        for family, share in shares.items()
    )


def _called(decided: Decided) -> str:
    """Return the name of an effect at its level; a family with the law that fits best."""
    effect = decided.finding.placed.effect
    return f"{effect.family.value} ({effect.spoken} fits best)" if decided.level is Level.FAMILY else effect.spoken


def _all_called(effects: Sequence[Decided]) -> list[str]:
    """Return the names of effects at their levels; a family once, with all its laws that fit best."""
    words: list[str] = []
    for e in effects:
        family = e.finding.placed.effect.family
        members = [o for o in effects if o.level is Level.FAMILY and o.finding.placed.effect.family is family]
        best = list(dict.fromkeys(o.finding.placed.effect.spoken for o in members))
        together = e.level is Level.FAMILY and len(best) > 1
        words.append(f"{family.value} ({_listed(best, 'and')} fit best)" if together else _called(e))
    return list(dict.fromkeys(words))


def _closed(decision: Decision, gap: Gap | None) -> str:
    """Return the closed share of the sealed gap, by the named effects if there are any; empty if it is uncertain."""
    sealed = gap.document() if gap is not None and len(gap.before) else {}
    if not sealed.get("certain"):
        return ""
    each, names = sealed["shares"], [e.finding.placed.effect.name for e in decision.effects if e.level is not None]
    share = sum(each.get(name, 0.0) for name in names) if names and any(each.values()) else sealed["closed"]
    part = "all" if share >= ALL_CLOSED else f"{100 * share:.0f} %"
    return f"{part} of the gap on sealed presses" if share >= LEAST_CLOSED else ""


def _nameless(findings: Findings, share_limit: float) -> str:
    """Return a clause on the unexplained share; empty below ``share_limit`` [1]."""
    if findings.left.t < LEFT_T or findings.share_left < share_limit:
        return ""
    part = f"{100 * findings.share_left:.0f} %" if findings.share_left >= SPEAKS_FROM else "less than 1 %"
    return f"; {part} of the explainable part has no name yet"


def _undecided(decision: Decision, gap: Gap | None) -> str:
    """Return the open questions (rivals, bounds, too few episodes), and the family if all rivals share it."""
    answer = [e.finding for e in decision.effects]
    shapes = [{p.name for p in f.placed.effect.shapes} & set(f.at_bound) for f in answer]
    bounds = [
        f.placed.effect.spoken for f, parameters in zip(answer, shapes, strict=True) if set(f.at_bound) - parameters
    ]
    formed = [f.placed.effect.spoken for f, parameters in zip(answer, shapes, strict=True) if parameters]
    weak = [f.placed.effect.spoken for f in answer if f.necessity < f.needed]
    words = _best(decision.effects) if any(f.rivals for f in answer) else _needed(decision.effects)
    either = [e for e in decision.effects if e.level is Level.FAMILY and e.status != "named"]
    shared = [e.finding.placed.effect.family.value for e in either]
    closed = _closed(decision, gap)
    facts = [f"it is {_listed(list(dict.fromkeys(shared)), 'and')}"] if shared else []
    facts += [f"{closed} is closed"] if closed else []
    words += f". Either way {' and '.join(facts)}" if facts else ""
    words += f"; {', '.join(bounds)} would need an unphysical size" if bounds else ""
    words += f"; {', '.join(formed)} fits best where its equation ends: the form is another one" if formed else ""
    words += f"; more presses must say whether {', '.join(weak)} is needed" if weak else ""
    clear = not (any(f.rivals or f.at_bound for f in answer) or weak or any(e.level for e in decision.effects))
    return words + (f"; {_against(gap)}" if clear else "")


def _needed(effects: Sequence[Decided]) -> str:
    """Return the certain effects and those that only fit best, of an answer without rivals."""
    names = _all_called([e for e in effects if e.status == "named"])
    fits = list(dict.fromkeys(e.finding.placed.effect.spoken for e in effects if e.status != "named"))
    words = [f"{_listed(names, 'and')} {'is' if len(names) == 1 else 'are'} there"] if names else []
    words += [f"{_listed(fits, 'and')} {'fits' if len(fits) == 1 else 'fit'} best"] if fits and not names else []
    words += [f"{_listed(fits, 'and')} may be there, too"] if fits and names else []
    return "; ".join(words)


def _odd(names: list[str]) -> str:
    """Return a sentence on presses unlike all others."""
    listed = ", ".join(names[:MOST_LISTED])
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return (
        f"{listed}{more}: unlike all other presses of their place, and no effect explains them: was something touched "
        "or moved, or is it another specimen (`press: {specimen: ...}` in an import's mapping)? Look at them "
        "(`tacdata view`), leave them out or record them again"
    )


def _closest(answer: list[FoundEffect], share: float, gap: Gap | None) -> str:
    """Return a clause on the best answer that is no name: the share it leaves, and its failure on sealed episodes."""
    names = list(dict.fromkeys(m.placed.effect.spoken for m in answer))
    single, words = len(names) == 1, _listed(names, "and")
    words += " fits best and leaves" if single else " together fit best and leave"
    words += f" {100 * share:.0f} % of the explainable part"
    it, name = ("it", "it is not the name") if single else ("them", "they are not the names")
    if gap is not None and len(gap.before):
        base, final = float(gap.before.mean()), float(gap.after.mean())
        against = gap.ratio is None or gap.ratio.observed < 0
        if against and (worse := worsened(base, final)):
            return (
                f"{words}, but sealed presses fit {worse} with {it} (mean square over the noise "
                f"{plain_number(base, 3)} without, {plain_number(final, 3)} with): {name}"
            )
    if instead := list(dict.fromkeys(load(r).spoken for m in answer for r in m.rivals)):
        substitutes = _listed(instead, "or") if len(instead) <= MOST_STAND_INS else f"{len(instead)} others"
        return f"{words}, and {substitutes} may explain {it} as well"
    return f"{words}, so {name}, or not all of it"


def _best(effects: Sequence[Decided]) -> str:
    """Return the effects without rivals, then those that fit best with their rivals."""
    unrivalled = [e for e in effects if not e.finding.rivals]
    calls = [_called(e) if e.status == "named" else e.finding.placed.effect.spoken for e in unrivalled]
    clear = list(dict.fromkeys(calls))
    groups: dict[frozenset[str], list[FoundEffect]] = {}
    for m in (e.finding for e in effects):
        if m.rivals:
            groups.setdefault(frozenset((m.placed.effect.called, *m.rivals)), []).append(m)
    words = "; ".join(_open(group) for group in groups.values())
    if not words:
        return _listed(clear, "and")
    are = "is" if len(clear) == 1 else "are"
    if clear:
        return (
            f"{_listed(clear, 'and')} {are} there. Another effect is, too. These recordings do not show which: {words}"
        )
    return f"these recordings do not show which effect it is: {words}"


def _open(group: list[FoundEffect]) -> str:
    """Return a clause on effects with the same rivals, and those rivals."""
    mechanisms = {m.placed.effect.called for m in group}
    names = list(dict.fromkeys(m.placed.effect.spoken for m in group))
    rivals = [name for name in dict.fromkeys(r for m in group for r in m.rivals) if name not in mechanisms]
    words = f"{names[0]} fits best" if len(names) == 1 else f"{_listed(names, 'and')} together fit best"
    if rivals:
        families = list(dict.fromkeys(load(name).family.value for name in rivals))
        instead = _listed([load(name).spoken for name in rivals], "or")
        if len(rivals) > MOST_STAND_INS:
            instead = f"{len(rivals)} others ({_listed(families, 'or')})"
        return f"{words}, but {instead} may explain {'it' if len(names) == 1 else 'any of them'} as well"
    return f"{words}, but each may explain the others' part"


def _listed(names: list[str], last: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"
