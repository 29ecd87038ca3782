"""The posterior over sets, averaged over samples of presses (as BayesBag).

Huggins & Miller (Bayesian Analysis 18, 2023, 1): a posterior that is averaged over samples stays honest where no model
is true. A set that one press alone supports loses its probability where that press is not drawn.

Samples are drawn without repeats. A bootstrap sample doubles presses, and the square of each score grows by its own
variance: among a hundred columns of a remainder, noise alone then makes one probable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.laplace import largest_information, log_evidence
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.priors import SetPrior


@dataclass(frozen=True)
class Posterior:
    """Probabilities of sets of effects and of the remainder's size."""

    models: tuple[Optimum, ...]
    """The sets; the empty one is among them."""
    weights: np.ndarray
    """Probability of each set with each size of the remainder [1], shape (sets, sizes)."""
    logs: np.ndarray
    """Logarithm of each set's evidence on all presses, its prior included, shape (sets,)."""
    sizes: tuple[float, ...]
    """Sizes of the remainder."""

    @property
    def sets(self) -> np.ndarray:
        """Probability of each set [1], shape (sets,)."""
        return self.weights.sum(axis=1)

    @property
    def best(self) -> Optimum:
        """The most probable set."""
        return self.models[int(np.argmax(self.sets))]

    @property
    def nothing(self) -> float:
        """Probability that there is neither an effect nor a remainder [1]."""
        at = [k for k, model in enumerate(self.models) if not model.placed]
        still = [k for k, size in enumerate(self.sizes) if size == 0]
        return float(self.weights[np.ix_(at, still)].sum())

    @property
    def empty(self) -> float:
        """Probability that there is no effect [1]."""
        return float(sum(w for w, model in zip(self.sets, self.models, strict=True) if not model.placed))

    @property
    def remainder(self) -> float:
        """Probability of a remainder [1]."""
        return float(self.weights[:, [k for k, size in enumerate(self.sizes) if size > 0]].sum())

    def with_empty(self, first: Posterior) -> Posterior:
        """Return the posterior with the probability of the empty set taken from another one, if that is larger.

        Noise that was estimated given effects is smaller than noise without: beside it the empty set loses unfairly.
        """
        own, other = self._empty, first._empty
        if first.sets[other] <= self.sets[own]:
            return self
        share = (1 - first.sets[other]) / max(1 - self.sets[own], 1e-300)
        weights = self.weights * share
        weights[own] = first.weights[other]
        return replace(self, weights=weights)

    @property
    def _empty(self) -> int:
        return next(k for k, model in enumerate(self.models) if not model.placed)

    def _shares(self, names: Sequence[set[str]]) -> dict[str, float]:
        shares: dict[str, float] = {}
        for weight, own in zip(self.sets, names, strict=True):
            for name in own:
                shares[name] = shares.get(name, 0.0) + float(weight)
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    @property
    def mechanisms(self) -> dict[str, float]:
        """Mechanism -> its probability [1], the largest first."""
        return self._shares([{p.effect.called for p in model.placed} for model in self.models])

    @property
    def families(self) -> dict[str, float]:
        """Family -> the probability that any of its mechanisms is there [1]."""
        return self._shares([{p.effect.family.value for p in model.placed} for model in self.models])

    @property
    def forms(self) -> dict[str, float]:
        """Effect (a form of a mechanism) -> its probability [1]."""
        return self._shares([{p.effect.name for p in model.placed} for model in self.models])


def bagged(
    models: Sequence[Optimum],
    prior: SetPrior,
    policy: Policy,
    share: float | None = None,
    known: dict[tuple[str, ...], np.ndarray] | None = None,
) -> Posterior:
    """Return the posterior over sets at their optimum.

    Args:
        models: Sets, the empty one among them, all beside one null model.
        prior: Of sets.
        policy: Number of samples, and priors.
        share: Presses of a sample [1]; that of the policy, unless given.
        known: Set -> its evidence where that was computed before, by name; new ones are added.
    """
    empty = next(model for model in models if not model.placed)
    largest = largest_information(empty)
    counts = sampled(empty, policy, policy.share if share is None else share)
    known = {} if known is None else known
    odds = [prior.of_set(p.effect for p in m.placed) for m in models]
    for m in models:
        if m.name not in known:
            known[m.name] = log_evidence(m, counts[:1], largest, policy)
    top = max(float(known[m.name][0].max()) + own for m, own in zip(models, odds, strict=True))
    for m, own in zip(models, odds, strict=True):
        done = known[m.name]
        if len(done) == len(counts):
            continue
        if not m.placed or float(done[0].max()) + own >= top - policy.far:
            known[m.name] = np.concatenate([done, log_evidence(m, counts[1:], largest, policy)])
    # A set that is far behind on all presses does not lead on a part of them.
    logs = np.full((len(counts), len(models), len(policy.sizes)), -1e9)
    for k, (m, own) in enumerate(zip(models, odds, strict=True)):
        logs[: len(known[m.name]), k] = known[m.name] + own
    shifted = np.exp(logs - logs.max(axis=(1, 2), keepdims=True))
    weights = shifted / shifted.sum(axis=(1, 2), keepdims=True)
    top = logs[0].max(axis=1, keepdims=True)
    whole = (top + np.log(np.exp(logs[0] - top).sum(axis=1, keepdims=True)))[:, 0]
    return Posterior(tuple(models), weights[1 if policy.bags else 0 :].mean(axis=0), whole, policy.sizes)


def sampled(empty: Optimum, policy: Policy, share: float) -> np.ndarray:
    """Return how often each press is drawn: all of them first, then the samples, shape (1 + samples, presses)."""
    presses = np.flatnonzero(np.einsum("eii->e", empty.gram) > 0)
    counts = np.zeros((policy.bags + 1, len(empty.gram)))
    counts[0, presses] = 1.0
    counts[1:, presses] = _drawn(len(presses), policy, share)
    return counts


def _drawn(presses: int, policy: Policy, share: float) -> np.ndarray:
    """Return how often each press is in each sample, shape (samples, presses).

    A share below 1 is drawn without repeats; a share of 1 is the bootstrap.
    """
    random = np.random.default_rng([policy.seed, 23])
    if share >= 1:
        return random.multinomial(presses, np.full(presses, 1 / max(presses, 1)), size=policy.bags)
    made, kept = np.zeros((policy.bags, presses)), max(round(share * presses), 1)
    for sample in made:
        sample[random.permutation(presses)[:kept]] = 1.0
    return made
