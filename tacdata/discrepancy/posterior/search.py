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
    null: NullModel
    """Noise and nuisances beside the best set."""
    given: Problem
    """The model as it was given, beside its own noise, with all that was tried."""
    prior: SetPrior


def posterior_of(setting: Setting, note: Note = lambda text: None, policy: Policy = POLICY) -> Search:
    """Return the posterior over sets of effects.

    Args:
        setting: Recordings, response, library.
        note: Is told what is being done.
        policy: Priors and sizes of the search.
    """
    null = null_model(setting)
    given = prepare(setting, null)
    prior = SetPrior.of((c.effect for c in given.candidates), policy)
    proposed = _proposed(given, prior, policy)
    proposed += [Proposal((late,), -np.inf) for late in delays(setting)]
    models = _refined(setting, null, proposed, [], policy)
    posterior = bagged(models, prior, policy)
    for _ in range(policy.rounds):
        best = posterior.best
        if not best.placed:
            break
        note(f"so far: {', '.join(dict.fromkeys(p.effect.spoken for p in best.placed))}")
        null = null_model(replace(setting, response=best.response, given=(*setting.given, *best.placed)))
        about = prepare(replace(setting, response=best.response), null, best.placed)
        proposed = _about(about, prior, policy)
        before = [Proposal(m.placed, float(w)) for m, w in zip(posterior.models, posterior.sets, strict=True)]
        models = _refined(setting, null, proposed, before, policy)
        posterior = bagged(models, prior, policy)
        if posterior.best.name == best.name:
            break
    return Search(posterior, null, given, prior)


def _proposed(problem: Problem, prior: SetPrior, policy: Policy) -> list[Proposal]:
    """Return sets of effects, as all presses and a bootstrap sample of them rank them."""
    presses = np.flatnonzero(problem.grams.rows > 0)
    share = np.full(len(presses), 1 / max(len(presses), 1))
    counts = np.zeros(len(problem.grams.rows))
    counts[presses] = np.random.default_rng([policy.seed, 29]).multinomial(len(presses), share)
    ranked = [proposals(problem, prior, policy, own, FIRST, policy.first) for own in (None, counts)]
    return _interleaved(ranked, policy.first)


def _about(problem: Problem, prior: SetPrior, policy: Policy) -> list[Proposal]:
    """Return sets about the placed one: with more effects, without one, with another in the place of one."""
    room = max(policy.most - len(problem.placed), 0)
    ranked = [proposals(problem, prior, policy, None, min(room, FIRST), policy.refined)]
    for at in range(len(problem.placed)):
        ranked.append(proposals(problem.without(at), prior, policy, None, min(room + 1, FIRST), policy.refined))
    return _interleaved(ranked, policy.refined)


def _interleaved(ranked: list[list[Proposal]], most: int) -> list[Proposal]:
    """Return the first of each ranking, then the second of each, without repeats."""
    made: dict[tuple[str, ...], Proposal] = {}
    for turn in range(max(len(own) for own in ranked)):
        for own in ranked:
            if turn < len(own) and len(made) < most:
                made.setdefault(own[turn].name, own[turn])
    return list(made.values())


def _refined(
    setting: Setting, null: NullModel, proposed: Iterable[Proposal], before: Iterable[Proposal], policy: Policy
) -> list[Optimum]:
    """Return sets at their optimum beside one null model: the empty one, those before, those proposed, their subsets."""
    wanted: dict[tuple[str, ...], tuple[Placed, ...]] = {(): ()}
    for one in (*sorted(before, key=lambda p: -p.log), *proposed):
        wanted.setdefault(one.name, one.placed)
    made: dict[tuple[str, ...], Optimum] = {}
    for name, placed in list(wanted.items())[: policy.refined + policy.first]:
        made[name] = optimum(setting, placed, null)
    return list(made.values())
