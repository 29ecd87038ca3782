"""The conclusion: a status and names, read off the probabilities of the posterior."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.bag import Posterior
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.effects import Placed


class Status(StrEnum):
    """What may be stated of recordings."""

    NAMED = "named"
    """Every effect of the most probable set has a name, and a remainder is improbable."""
    INCOMPLETE = "named, incomplete"
    """An effect or a family has a name, and something else is there."""
    AMBIGUOUS = "ambiguous"
    """Some effect is there; several may be it."""
    UNKNOWN = "unknown"
    """Something is there that no effect of the library explains."""
    NONE = "none"
    """Nothing is missing that these recordings would show."""


class Level(StrEnum):
    """How fine a name is."""

    FAMILY = "family"
    MECHANISM = "mechanism"
    FORM = "form"


@dataclass(frozen=True)
class Named:
    """One effect of the most probable set."""

    placed: Placed
    at: int
    """Its place in the set."""
    probability: float
    """Of its mechanism [1]."""
    family: float
    """Of its family [1]."""
    form: float
    """Of its form [1]."""
    level: Level | None
    """The finest level that has a name; None: it is open."""
    alternatives: tuple[str, ...]
    """Mechanisms in its place, the most probable first; with it they hold the probability of a name."""


@dataclass(frozen=True)
class Conclusion:
    """What the posterior allows to be stated."""

    status: Status
    best: Optimum
    """The most probable set."""
    effects: tuple[Named, ...]


def conclude(posterior: Posterior, policy: Policy, coarse: Posterior | None = None) -> Conclusion:
    """Return status and names.

    Where a remainder is probable, the model is known to be wrong, and evidence is worth less than it seems (the
    coarsened posterior: Miller & Dunson, J. Am. Stat. Assoc. 114, 2019, 1113). Names are then those of smaller samples.

    Args:
        posterior: Probabilities of sets of effects, and of the remainder.
        coarse: The same from smaller samples.
        policy: Probabilities from which on something has a name.
    """
    names = coarse if coarse is not None and posterior.remainder > policy.remainder else posterior
    effects = tuple(_named(names, names.best, at, policy) for at in range(len(names.best.placed)))
    return Conclusion(_status(posterior, names, effects, policy), names.best, effects)


def _status(posterior: Posterior, names: Posterior, effects: tuple[Named, ...], policy: Policy) -> Status:
    """Return the status; `names`: the posterior that names are read off."""
    if posterior.nothing >= policy.none:
        return Status.NONE
    levels = [e.level for e in effects]
    remainder = posterior.remainder > policy.remainder
    if any(levels):
        if all(levels) and not remainder:
            return Status.AMBIGUOUS if Level.FAMILY in levels else Status.NAMED
        fine = any(level in (Level.MECHANISM, Level.FORM) for level in levels)
        return Status.INCOMPLETE if fine or remainder else Status.AMBIGUOUS
    if 1 - names.empty >= policy.named:
        return Status.AMBIGUOUS
    return Status.UNKNOWN if 1 - posterior.nothing >= policy.named else Status.NONE


def _named(posterior: Posterior, best: Optimum, at: int, policy: Policy) -> Named:
    """Return one effect of the most probable set with its probabilities, level and alternatives."""
    effect = best.placed[at].effect
    mechanism = posterior.mechanisms.get(effect.called, 0.0)
    family = posterior.families.get(effect.family.value, 0.0)
    form = posterior.forms.get(effect.name, 0.0)
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
