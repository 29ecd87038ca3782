"""The conclusion in a sentence. It decides nothing."""

from __future__ import annotations

from collections.abc import Sequence

from tacdata.chain import Course
from tacdata.discrepancy.report.conclusion import Certainty, Conclusion, Level, Named, Reason, Status
from tacdata.effects import load

LEAST_CLOSED = 0.01
"""Least closed share of the sealed gap that is mentioned [1]."""
ALL_CLOSED = 0.995
"""Closed share of the gap that counts as all of it: it would be printed as 100 % [1]."""
FINE = 0.99
"""From this probability on, and as near to none, a digit behind the point is written [1]."""
SUREST = 0.999
"""A larger probability is written as one beyond it [1]."""
MOST_LISTED = 6
"""Most presses that are listed by name."""
MOST_ALTERNATIVES = 3
"""Most alternatives that are listed by name; of more, the families are listed."""


def sentence_of(conclusion: Conclusion, course: Course) -> str:
    """Return the verdict in a sentence.

    Args:
        conclusion: What is stated.
        course: The recordings.
    """
    checks, effects = conclusion.checks, conclusion.effects
    best = f"; so far {_listed(_names(effects), 'and')} fits best" if effects else ""
    match conclusion.reason:
        case Reason.CONTRADICTION:
            return "; ".join(checks.contradictions if checks else ())
        case Reason.TOO_FEW:
            return f"{course.episodes} presses cannot carry a verdict{best}"
        case Reason.STOPPED:
            found = "no gap" if conclusion.status is Status.NONE else "a gap"
            return f"stopped after {conclusion.until.value}: {found}{best}"
        case Reason.ODD:
            return _odd([course.names[k] for k in conclusion.odd])
        case Reason.ALARM:
            return f"no effect of the library shows, but {_seen(conclusion)}"
        case Reason.SEALED:
            return f"{_fit(effects)} the presses that were judged; {_against(conclusion)}: not the name"
    match conclusion.status:
        case Status.NONE:
            return _quiet(conclusion)
        case Status.NAMED:
            return _named(conclusion)
        case Status.INCOMPLETE:
            return _incomplete(conclusion)
        case Status.AMBIGUOUS:
            return _ambiguous(conclusion)
    return _unknown(conclusion)


def _quiet(conclusion: Conclusion) -> str:
    checks = conclusion.checks
    if checks and checks.watched:
        return f"no effect of the library shows, but {'; '.join(checks.watched)}"
    if checks and checks.base:
        return (
            "no effect of time, rate or path shows; what depends on the pose alone, as stiffness and compliance, "
            "cannot be judged without a model of the sensor"
        )
    return "nothing is missing that these recordings would show; see the detection limits"


def _named(conclusion: Conclusion) -> str:
    return f"{_there(conclusion.effects, conclusion)}; {_sure(conclusion.effects)}"


def _incomplete(conclusion: Conclusion) -> str:
    """Return the named effects, then the suspected ones and the remainder."""
    still = _names([e for e in conclusion.effects if e.certainty is not Certainty.NAMED])
    words = f"{_there(conclusion.named, conclusion)}; {_sure(conclusion.named)}"
    words += f"; {_listed(still, 'and')} may be there, too" if still else ""
    if conclusion.remainder > conclusion.policy.remainder:
        words += f"; something without a name is there, too ({percent(conclusion.remainder)} probable)"
    return words


def _ambiguous(conclusion: Conclusion) -> str:
    """Return the effects that are there, then those that are open with their alternatives."""
    sure = [e for e in conclusion.effects if e.level in (Level.MECHANISM, Level.FORM)]
    still = [e for e in conclusion.effects if e not in sure]
    begins = f"{_there(sure, conclusion)}. Something else is, too: " if sure else ""
    groups: dict[frozenset[str], list[Named]] = {}
    for one in still:
        groups.setdefault(frozenset((one.placed.effect.called, *one.alternatives)), []).append(one)
    words = f"{begins}these recordings do not show which effect it is: {'; '.join(map(_open, groups.values()))}"
    families = list(dict.fromkeys(e.placed.effect.family.value for e in still if e.level is Level.FAMILY))
    facts = [f"it is {_listed(families, 'and')}"] if families else []
    facts += [f"{share} is closed"] if (share := _closed(conclusion.effects, conclusion)) and not sure else []
    return words + (f". Either way {' and '.join(facts)}" if facts else "")


def _unknown(conclusion: Conclusion) -> str:
    evidence = f": {_seen(conclusion)}" if conclusion.alarms else ""
    if not conclusion.effects:
        return f"something is missing that no modelled effect explains{evidence}"
    closest = ", ".join(f"{_name(e)} {percent(e.probability)}" for e in conclusion.effects)
    return f"something is missing that has no name; the most probable effects: {closest}{evidence}"


def _open(group: Sequence[Named]) -> str:
    """Return a clause on effects with the same alternatives, and those."""
    words = " and ".join(f"{name} {percent(e.probability)}" for e, name in zip(group, _spoken(group), strict=True))
    called = {e.placed.effect.called for e in group}
    others = [name for name in group[0].alternatives if name not in called]
    if not others:
        return f"{words} probable"
    if len(others) > MOST_ALTERNATIVES:
        families = _listed(list(dict.fromkeys(load(name).family.value for name in others)), "or")
        return f"{words} probable, else one of {len(others)} others ({families})"
    return f"{words} probable, else {_listed([load(name).spoken for name in others], 'or')}"


def _there(effects: Sequence[Named], conclusion: Conclusion) -> str:
    """Return a clause on the presence of effects, with the share of the sealed gap that they close."""
    names, closed = _names(effects), _closed(effects, conclusion)
    single = len(names) == 1
    clause = f"{_listed(names, 'and')} {'is' if single else 'are'} there"
    return f"{clause} and {'closes' if single else 'close'} {closed}" if closed else clause


def _sure(effects: Sequence[Named]) -> str:
    """Return the probability of the least probable of some names, in words."""
    shares = [e.family if e.level is Level.FAMILY else e.probability for e in effects]
    return f"{percent(min(shares, default=0.0))} probable" + (" each, at least" if len(shares) > 1 else "")


def _closed(effects: Sequence[Named], conclusion: Conclusion) -> str:
    """Return the closed share of the sealed gap, by some effects; empty if it is uncertain."""
    sealed = conclusion.sealed.document() if conclusion.sealed is not None else {}
    if not sealed.get("certain"):
        return ""
    each = sealed["shares"]
    share = sum(each.get(e.placed.effect.name, 0.0) for e in effects) if any(each.values()) else sealed["closed"]
    part = "all" if share >= ALL_CLOSED else f"{100 * share:.0f} %"
    return f"{part} of the gap on sealed presses" if share >= LEAST_CLOSED else ""


def _against(conclusion: Conclusion) -> str:
    """Return the evidence of sealed presses against an answer as a clause."""
    ratio = conclusion.sealed.ratio if conclusion.sealed is not None else None
    if ratio is None:
        return "the sealed ones do not show it"
    share, error = 100 * ratio.share, 100 * ratio.error
    return f"the sealed ones do not show it (they hold {share:.0f} % of it, with a standard error of {error:.0f} %)"


def _seen(conclusion: Conclusion) -> str:
    return "; ".join(alarm.seen for alarm in conclusion.alarms)


def _odd(names: list[str]) -> str:
    """Return a sentence on presses unlike all others."""
    listed = ", ".join(names[:MOST_LISTED])
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return f"{listed}{more}: unlike all other presses of their place, and no effect explains them"


def _fit(effects: Sequence[Named]) -> str:
    names = _names(effects)
    return f"{_listed(names, 'and')} {'fits' if len(names) == 1 else 'fit'}"


def _spoken(effects: Sequence[Named]) -> list[str]:
    return [e.placed.effect.spoken for e in effects]


def _name(one: Named) -> str:
    """Return the name of an effect at its level; a family with its most probable law."""
    effect = one.placed.effect
    return f"{effect.family.value} (most probably {effect.spoken})" if one.level is Level.FAMILY else effect.spoken


def _names(effects: Sequence[Named]) -> list[str]:
    return list(dict.fromkeys(_name(e) for e in effects))


def percent(share: float) -> str:
    """Return a probability [1] in percent; no model makes one of 0 or 100 %."""
    if share > SUREST or share < 1 - SUREST:
        return f"over {100 * SUREST:g} %" if share > SUREST else f"under {100 * (1 - SUREST):.1f} %"
    return f"{100 * share:.1f} %" if share >= FINE or share < 1 - FINE else f"{100 * share:.0f} %"


def _listed(names: list[str], last: str) -> str:
    return "" if not names else names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"
