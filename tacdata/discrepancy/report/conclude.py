"""From probabilities to a status, a reason and names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.bag import Posterior, sampled
from tacdata.discrepancy.posterior.estimates import estimates
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.presence import presences
from tacdata.discrepancy.posterior.search import Search
from tacdata.discrepancy.report.conclusion import Certainty, Conclusion, Level, Named, Reason, SetProbability, Status
from tacdata.discrepancy.report.sealed_gap import FEWEST_TO_SEAL, borne_out, refuted


def conclude(search: Search, policy: Policy) -> Conclusion:
    """Return status and names.

    Where a remainder is probable, the model is known to be wrong, and evidence is worth less than it seems (the
    coarsened posterior: Miller & Dunson, J. Am. Stat. Assoc. 114, 2019, 1113). Names are then those of smaller samples.
    So they are where presses are too few to seal any: no other presses test a name.

    Args:
        search: Probabilities of sets of effects, and of the remainder.
        policy: Probabilities from which on something has a name.
    """
    few = np.count_nonzero(search.given.grams.rows > 0) < FEWEST_TO_SEAL
    posterior = search.coarse if few else search.posterior
    names = search.coarse if posterior.remainder > policy.remainder else posterior
    best, there = _present(names, _needed(names), search, policy)
    # An effect that is improbable as presses scatter is no part of the answer.
    kept = [at for at, own in enumerate(there) if own >= policy.there]
    effects = tuple(_named(names, best, at, policy, there[at]) for at in kept)
    absent = float(np.prod([1 - own for own in there])) if there else 0.0
    empty = max(names.empty, absent)
    still = 1 - posterior.remainder
    nothing = max(posterior.nothing, absent * still)
    status, reason = _status(nothing, empty, posterior.remainder, effects, policy)
    sets = listed_sets(names, policy, best)
    own = next(s for s in sets if s.placed == best.placed)
    effects = tuple(replace(e, estimates=own.estimates[e.at], bought=_bought(names, best, e.at)) for e in effects)
    return _certain(
        Conclusion(
            status,
            reason,
            effects,
            best,
            sets,
            names.mechanisms,
            names.families,
            nothing,
            posterior.remainder,
            dict(zip(posterior.sizes, posterior.weights.sum(axis=0).tolist(), strict=True)),
            policy=policy,
        )
    )


def _present(posterior: Posterior, best: Optimum, search: Search, policy: Policy) -> tuple[Optimum, tuple[float, ...]]:
    """Return a set without effects that are improbable as presses scatter, where that was made; and presences [1]."""
    made = {m.name: k for k, m in enumerate(posterior.models)}
    while True:
        there = presences(posterior.models, posterior.logs, made[best.name], search.prior, policy)
        least = min(range(len(there)), key=lambda at: there[at], default=None)
        if least is None or len(there) == 1 or there[least] >= policy.there or _without(best, least) not in made:
            return best, there
        best = posterior.models[made[_without(best, least)]]


def _needed(posterior: Posterior) -> Optimum:
    """Return the most probable set, without effects that explain no more than another's equation may be off.

    Evidence trusts equations. The energy of an effect times the square of its `form_error` is no evidence of a second
    one, in whatever direction it lies.
    """
    best, made = posterior.best, {m.name: m for m in posterior.models}
    while len(best.placed) > 1:
        bought = [_bought(posterior, best, at) for at in range(len(best.placed))]
        alone = [_explained(made.get((p.effect.name,)), made[()]) for p in best.placed]
        large = [max(own, by) for own, by in zip(alone, bought, strict=True)]
        off = [p.effect.form_error**2 * by for p, by in zip(best.placed, large, strict=True)]
        spare = [k for k, by in enumerate(bought) if by < max(o for j, o in enumerate(off) if j != k)]
        nested = [made.get(_without(best, k)) for k in sorted(spare, key=lambda k: bought[k])]
        simpler = next((model for model in nested if model is not None), None)
        if simpler is None:
            break
        best = simpler
    return best


def _explained(model: Optimum | None, empty: Optimum) -> float:
    """Return by how much half the sum of squares falls by a set [1]; 0 for one that was not made."""
    return max(float(empty.energy.sum() - model.energy.sum()), 0.0) if model is not None else 0.0


def _without(model: Optimum, at: int) -> tuple[str, ...]:
    """Return the name of a set without one of its effects."""
    return tuple(sorted(p.effect.name for k, p in enumerate(model.placed) if k != at))


def listed_sets(posterior: Posterior, policy: Policy, best: Optimum) -> tuple[SetProbability, ...]:
    """Return the sets that are probable, and the best one, with estimates of their numbers, the most probable first."""
    empty = next(k for k, m in enumerate(posterior.models) if not m.placed)
    counts = sampled(posterior.models[empty], policy, policy.share)
    made = []
    for k in np.argsort(-posterior.sets):
        probability, model = float(posterior.sets[k]), posterior.models[k]
        if made and probability < policy.least and model is not best:
            continue
        size = float(np.dot(posterior.sizes, posterior.weights[k]) / max(probability, 1e-300))
        found = estimates(model, posterior.models[empty], counts, size, policy)
        log = float(posterior.logs[k] - posterior.logs[empty])
        made.append(SetProbability(model.placed, probability, log, found))
    return tuple(made)


def with_alarms(conclusion: Conclusion, seen: tuple[Alarm, ...]) -> Conclusion:
    """Return the conclusion with the alarms: where no effect is probable, they and odd presses make it unknown."""
    result = replace(conclusion, alarms=seen)
    if result.status is Status.NONE and (seen or result.odd):
        return _certain(replace(result, status=Status.UNKNOWN, reason=Reason.ALARM if seen else Reason.ODD))
    return result


def with_sealed(conclusion: Conclusion) -> Conclusion:
    """Return the conclusion as sealed presses leave it: they withdraw names, and never give one."""
    if not conclusion.named or conclusion.sealed is None:
        return conclusion
    if refuted(conclusion.sealed):
        return _certain(replace(conclusion, status=Status.UNKNOWN, reason=Reason.SEALED))
    if borne_out(conclusion.sealed) or conclusion.sealed.interval[0] > 0:
        return conclusion
    effects = tuple(replace(e, level=None) for e in conclusion.effects)
    return _certain(replace(conclusion, effects=effects, status=Status.AMBIGUOUS, reason=Reason.SEALED))


def with_checks(conclusion: Conclusion) -> Conclusion:
    """Return the conclusion as the recordings' own faults leave it."""
    checks = conclusion.checks
    if checks is None or not (checks.contradictions or checks.too_few):
        return conclusion
    reason = Reason.CONTRADICTION if checks.contradictions else Reason.TOO_FEW
    return _certain(replace(conclusion, status=Status.UNKNOWN, reason=reason))


def with_gains(conclusion: Conclusion, beyond: list[Named]) -> Conclusion:
    """Return the conclusion with gains beyond calibration, which have a name, or are open, by their own size."""
    if not beyond:
        return conclusion
    result = replace(conclusion, effects=(*conclusion.effects, *beyond))
    is_open = any(e.certainty is not Certainty.NAMED for e in beyond)
    if result.status is Status.NONE:
        status, reason = (Status.AMBIGUOUS, Reason.OPEN) if is_open else (Status.NAMED, Reason.NAMED)
        return replace(result, status=status, reason=reason)
    if result.status is Status.NAMED and is_open:
        return replace(result, status=Status.INCOMPLETE, reason=Reason.OPEN)
    return result


def _certain(conclusion: Conclusion) -> Conclusion:
    """Return the conclusion with the certainty of each effect; none of them is listed where nothing is missing."""
    if conclusion.status is Status.NONE:
        return replace(conclusion, effects=())
    effects = []
    for e in conclusion.effects:
        if conclusion.status is Status.UNKNOWN:
            own = replace(e, level=None, certainty=Certainty.SUSPECTED)
        elif e.level is not None:
            own = replace(e, certainty=Certainty.NAMED)
        else:
            open_one = conclusion.status is Status.AMBIGUOUS
            own = replace(e, certainty=Certainty.AMBIGUOUS if open_one else Certainty.SUSPECTED)
        effects.append(own)
    return replace(conclusion, effects=tuple(effects))


def _status(
    nothing: float, empty: float, left: float, effects: tuple[Named, ...], policy: Policy
) -> tuple[Status, Reason]:
    """Return the status and its reason.

    Args:
        nothing: Probability of neither effect nor remainder [1].
        empty: Probability of no effect [1].
        left: Probability of a remainder [1].
        effects: Of the most probable set.
        policy: Probabilities from which on something has a name.
    """
    if nothing >= policy.none:
        return Status.NONE, Reason.QUIET
    levels = [e.level for e in effects]
    remainder = left > policy.remainder
    why = Reason.REMAINDER if remainder else Reason.OPEN
    if any(levels):
        if all(levels) and not remainder:
            return (Status.AMBIGUOUS, Reason.OPEN) if Level.FAMILY in levels else (Status.NAMED, Reason.NAMED)
        fine = any(level in (Level.MECHANISM, Level.FORM) for level in levels)
        return (Status.INCOMPLETE if fine or remainder else Status.AMBIGUOUS), why
    if 1 - empty >= policy.named:
        return Status.AMBIGUOUS, why
    if 1 - nothing >= policy.named:
        return Status.UNKNOWN, why
    return Status.NONE, Reason.QUIET


def _bought(posterior: Posterior, best: Optimum, at: int) -> float:
    """Return by how much half the sum of squares rises without one effect; of the empty set where that was not made."""
    made = {m.name: m for m in posterior.models}
    return _explained(best, made.get(_without(best, at)) or made[()])


def _named(posterior: Posterior, best: Optimum, at: int, policy: Policy, there: float) -> Named:
    """Return one effect of the most probable set with its probabilities, level and alternatives.

    `there`: probability that it, or another in its place, is there, as presses scatter [1].
    """
    effect = best.placed[at].effect
    mechanism = min(posterior.mechanisms.get(effect.called, 0.0), there)
    family = min(posterior.families.get(effect.family.value, 0.0), there)
    form = min(posterior.forms.get(effect.name, 0.0), there)
    level = None
    if mechanism >= policy.named:
        several = len({name for m in posterior.models for name in m.name if _called(m, name) == effect.called}) > 1
        level = Level.FORM if form >= policy.named and several else Level.MECHANISM
    elif family >= policy.named and not _family_named(posterior, best, at, policy):
        level = Level.FAMILY
    return Named(best.placed[at], at, mechanism, family, form, level, _alternatives(posterior, best, at, policy))


def _called(model: Optimum, name: str) -> str:
    return next(p.effect.called for p in model.placed if p.effect.name == name)


def _family_named(posterior: Posterior, best: Optimum, at: int, policy: Policy) -> bool:
    """Return whether another effect of the set has a name and is of the same family: that may be all of it."""
    family = best.placed[at].effect.family
    return any(
        p.effect.family is family and posterior.mechanisms.get(p.effect.called, 0.0) >= policy.named
        for k, p in enumerate(best.placed)
        if k != at
    )


def _alternatives(posterior: Posterior, best: Optimum, at: int, policy: Policy) -> tuple[str, ...]:
    """Return mechanisms that take an effect's place, until the probability of a name is reached."""
    called, inside = best.placed[at].effect.called, {p.effect.called for p in best.placed}
    shares: dict[str, float] = {}
    for weight, model in zip(posterior.sets, posterior.models, strict=True):
        names = {p.effect.called for p in model.placed}
        if called not in names:
            for name in names - inside:
                shares[name] = shares.get(name, 0.0) + float(weight)
    reached, result = posterior.mechanisms.get(called, 0.0), []
    for name, share in sorted(shares.items(), key=lambda item: -item[1]):
        if reached >= policy.named or share < policy.least:
            break
        result.append(name)
        reached += share
    return tuple(result)
