"""Presence: the probability that anything of its kind is there at all, by the scatter of presses.

An evidence believes the covariance of the noise. Where few presses, or a law outside the library, make scores scatter
by more than that, an effect seems surer than it is. The scale of its scores is then unknown, and is integrated out:
over presses the effect's size has a t distribution (Liang & Zeger, Biometrika 73, 1986, 13, for the scatter).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.priors import SetPrior

SHOWN = 1e-6
"""A press shows an effect from this share of its information on [1]."""


@dataclass(frozen=True)
class Scatter:
    """How the score of one effect of a set scatters over presses."""

    ratio: float
    """Variance of its scores over that of the covariance, along its size, at least 1 [1]."""
    freedom: int
    """Presses that show it, less its amplitudes; at least 1."""

    def honest(self, gain: float) -> float:
        """Return a logarithm of a likelihood ratio with the scale of the scores integrated out [1].

        Args:
            gain: The logarithm with known scales.
        """
        n = self.freedom
        return 0.5 * (n + 1) * float(np.log1p(2 * max(gain, 0.0) / (self.ratio * n)))


def scatter(model: Optimum, at: int, policy: Policy) -> Scatter:
    """Return the scatter of one effect's scores at a set's optimum.

    Args:
        model: The set.
        at: Which of its effects.
        policy: With the prior of the response's own error.
    """
    knobs, forms, numerics, nuisances, _ = model.counts
    own = np.array([k + 1 for k, knob in enumerate(model.knobs) if knob.at == at and not knob.shape], dtype=int)
    other = np.array([k + 1 for k, knob in enumerate(model.knobs) if knob.at != at], dtype=int)
    last = 1 + knobs + forms + numerics + nuisances
    beside = np.concatenate([other, np.arange(1 + knobs + forms, last)]).astype(int)
    weight = np.concatenate([np.ones(len(other)), np.full(numerics, 1 / policy.numerics**2), model.ridge])
    total = model.gram.sum(axis=0)
    first = np.append(0, own)
    matrix = total[np.ix_(beside, beside)] + np.diag(weight + 1e-9)
    turn = np.zeros((model.gram.shape[1], len(first)))
    turn[first, np.arange(len(first))] = 1.0
    turn[beside] = -np.linalg.solve(matrix, total[np.ix_(beside, first)])
    each = turn.T @ model.gram @ turn
    size = np.array([_size(model, k) for k in own - 1])
    along = np.einsum("eij,i,j->e", each[:, 1:, 1:], size, size)
    information = float(along.sum())
    score = each[:, 0, 1:] @ size
    score = score - along * float(score.sum()) / max(information, 1e-12)
    shown = max(int(np.count_nonzero(along > SHOWN * max(information, 1e-12))), 1)
    spread = float(np.square(score).sum()) * shown / max(shown - 1, 1)
    return Scatter(max(spread / max(information, 1e-12), 1.0), max(shown - len(own), 1))


def _size(model: Optimum, k: int) -> float:
    """Return the size of an amplitude [typical sizes]."""
    knob = model.knobs[k]
    return (knob.value(model.placed) - knob.parameter.default) / knob.parameter.typical


def presences(
    models: Sequence[Optimum], logs: np.ndarray, best: int, prior: SetPrior, policy: Policy
) -> tuple[float, ...]:
    """Return the probability that each effect of a set, or another in its place, is there [1].

    Args:
        models: All sets.
        logs: Logarithm of their evidence on all presses, with the prior, shape (sets,).
        best: Which set.
        prior: Of sets.
        policy: With the priors.
    """
    model, made = models[best], {m.name: k for k, m in enumerate(models)}
    found = []
    for at, one in enumerate(model.placed):
        name = tuple(sorted(p.effect.name for k, p in enumerate(model.placed) if k != at))
        without = made.get(name, made[()])
        before = prior.of_set([one.effect])
        gain = float(logs[best] - logs[without]) - before
        found.append(float(expit(scatter(model, at, policy).honest(gain) + before)))
    return tuple(found)
