"""From a setting to the posterior: proposals on linear columns, refined on the chain, in rounds about the best set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from tacdata.discrepancy.evidence.optimum import Optimum, optimum
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import NullModel, null_model
from tacdata.discrepancy.posterior.bag import Posterior, bagged
from tacdata.discrepancy.posterior.beam import Proposal, proposals
from tacdata.discrepancy.posterior.policy import POLICY, Policy
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.regressors.delays import delays
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.effects import Placed

Note = Callable[[str], None]
FIRST = 2
"""Effects that are added at once, at most: to first order more are not told apart."""


@dataclass(frozen=True)
class Search:
    """The posterior, and what it rests on."""

    posterior: Posterior
    coarse: Posterior
    """The same from smaller samples: names beside a remainder."""
    null: NullModel
    """Noise and nuisances beside the best set."""
    given: Problem
    """The model as it was given, beside its own noise, with all that was tried."""
    prior: SetPrior


def posterior_of(
    setting: Setting, note: Note = lambda text: None, policy: Policy = POLICY, given: Problem | None = None
) -> Search:
    """Return the posterior over sets of effects.

    Args:
        setting: Recordings, response, library.
        note: Called with each step.
        policy: Priors and sizes of the search.
        given: The model as it was given, where that was prepared before.
    """
    given = given or prepare(setting, null_model(setting))
    null = given.null
    prior = SetPrior.of((c.effect for c in given.candidates), policy)
    proposed = _proposed(given, prior, policy)
    proposed += [Proposal((late,), -np.inf) for late in delays(setting)]
    made: dict[tuple[str, ...], Optimum] = {}
    known: dict[tuple[str, ...], np.ndarray] = {}
    first = posterior = _posterior(setting, null, made, proposed, prior, policy, known, policy.steps)
    seen: set[tuple[str, ...]] = set()
    for turn in range(policy.rounds):
        best = posterior.best
        if not best.placed or best.name in seen:
            break
        seen.add(best.name)
        note(f"so far: {', '.join(dict.fromkeys(p.effect.spoken for p in best.placed))}")
        there = replace(setting, response=best.response)
        if turn == 0:
            # Noise that was estimated without a large effect is too large. Later sets share one noise.
            null, made = null_model(replace(there, given=(*setting.given, *best.placed))), {}
            known = {}
            pairs = zip(posterior.models, posterior.sets, strict=True)
            proposed = [Proposal(m.placed, float(w)) for m, w in pairs if w >= policy.least]
        else:
            proposed = []
        proposed += _about(prepare(there, null, best.placed), prior, policy)
        posterior = _posterior(setting, null, made, proposed, prior, policy, known, policy.later)
    # The presence of an effect is judged by the set without it.
    best = posterior.best.placed
    rest = [Proposal(tuple(p for p in best if p is not one), 0.0) for one in best]
    posterior = _posterior(setting, null, made, rest, prior, policy, known, policy.later)
    coarse = bagged(posterior.models, prior, policy, policy.coarse).with_empty(
        bagged(first.models, prior, policy, policy.coarse)
    )
    return Search(posterior.with_empty(first), coarse, null, given, prior)


def without_effects(setting: Setting, policy: Policy = POLICY, given: Problem | None = None) -> Search:
    """Return the posterior of nothing against a remainder: no effect is tried."""
    given = given or prepare(setting, null_model(setting))
    prior = SetPrior.of((), policy)
    alone = bagged([optimum(setting, (), given.null)], prior, policy)
    return Search(alone, alone, given.null, given, prior)


def _posterior(
    setting: Setting,
    null: NullModel,
    made: dict[tuple[str, ...], Optimum],
    proposed: Iterable[Proposal],
    prior: SetPrior,
    policy: Policy,
    known: dict[tuple[str, ...], np.ndarray],
    steps: int,
) -> Posterior:
    """Return the posterior of the empty set, sets at their optimum before, and those proposed, which join `made`."""
    wanted: dict[tuple[str, ...], tuple[Placed, ...]] = {(): ()}
    for one in proposed:
        wanted.setdefault(one.name, one.placed)
    for name, placed in wanted.items():
        if name not in made:
            made[name] = optimum(setting, placed, null, steps)
    return bagged(list(made.values()), prior, policy, known=known)


def _proposed(problem: Problem, prior: SetPrior, policy: Policy) -> list[Proposal]:
    """Return sets of effects, as all presses and a bootstrap sample of them rank them."""
    presses = np.flatnonzero(problem.grams.rows > 0)
    share = np.full(len(presses), 1 / max(len(presses), 1))
    counts = np.zeros(len(problem.grams.rows))
    counts[presses] = np.random.default_rng([policy.seed, 29]).multinomial(len(presses), share)
    ranked = [proposals(problem, prior, policy, own, FIRST, policy.first) for own in (None, counts)]
    return _interleaved([_near(own, policy) for own in ranked], policy.first)


def _about(problem: Problem, prior: SetPrior, policy: Policy) -> list[Proposal]:
    """Return sets about the placed one: with more effects, without one, with another in the place of one."""
    room = max(policy.most - len(problem.placed), 0)
    ranked = [proposals(problem, prior, policy, None, min(room, FIRST), policy.refined)]
    for at in range(len(problem.placed)):
        ranked.append(proposals(problem.without(at), prior, policy, None, min(room + 1, FIRST), policy.refined))
    return _interleaved([_near(own, policy) for own in ranked], policy.refined)


def _near(ranking: list[Proposal], policy: Policy) -> list[Proposal]:
    """Return the proposals that may matter beside the best one of their ranking."""
    top = max((one.log for one in ranking), default=0.0)
    reach = max(policy.near, policy.rough * top)
    return [one for one in ranking if one.log >= top - reach]


def _interleaved(ranked: list[list[Proposal]], most: int) -> list[Proposal]:
    """Return the first of each ranking, then the second of each, without repeats."""
    made: dict[tuple[str, ...], Proposal] = {}
    for turn in range(max(len(own) for own in ranked)):
        for own in ranked:
            if turn < len(own) and len(made) < most:
                made.setdefault(own[turn].name, own[turn])
    return list(made.values())
