"""Proposals: the most probable sets of effects on linear columns, by a beam search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.posterior.laplace import size_prior
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import bounded, eliminated
from tacdata.effects import Placed

EXCITED = 1e-6
"""Least information of a column that presses show [1]."""


@dataclass(frozen=True)
class Proposal:
    """A set of effects with first values of their numbers."""

    placed: tuple[Placed, ...]
    log: float
    """Logarithm of its evidence to first order, with its prior, over that of nothing more [1]."""

    @property
    def name(self) -> tuple[str, ...]:
        """Its effects, by name."""
        return tuple(sorted(p.effect.name for p in self.placed))


def proposals(
    problem: Problem, prior: SetPrior, policy: Policy, counts: np.ndarray | None, most: int, length: int
) -> list[Proposal]:
    """Return sets beside what is placed already, the most probable first.

    Args:
        problem: Columns of all candidates, and what stands beside them.
        prior: Of sets.
        policy: Sizes of the beam, and of the remainder.
        counts: How often each press is drawn, shape (presses,); None: once each.
        most: Effects that are added at most.
        length: Sets that are returned at most.
    """
    linear = _Linear(problem, prior, policy, counts)
    scored = linear.search(most)[:length]
    return [Proposal((*problem.placed, *linear.placed(key)), log) for key, log in scored]


class _Linear:
    """Candidates on Gram matrices, all that stands beside them regressed out, for each size of the remainder."""

    def __init__(self, problem: Problem, prior: SetPrior, policy: Policy, counts: np.ndarray | None) -> None:
        self.problem, self.policy = problem, policy
        gram = problem.grams.gram
        fixed, ridge = problem.fixed, problem.fixed_ridge(1e-6)
        if problem.numerics is not None:
            fixed, ridge = np.append(fixed, problem.numerics), np.append(ridge, 1 / policy.numerics**2)
        gram = eliminated(gram, fixed, ridge)
        total = gram.sum(axis=0) if counts is None else np.tensordot(counts, gram, axes=1)
        taken = {p.effect.called for p in (*problem.setting.given, *problem.placed)}
        information = np.diag(total)[1:]
        self.candidates: list[Candidate] = [
            c
            for c in problem.candidates
            if c.called not in taken
            and np.isfinite(prior.logs.get(c.effect.name, -np.inf))
            and information[c.columns].max(initial=0.0) > EXCITED
        ]
        self.shapes = {name: sum(c.effect.name == name for c in self.candidates) for name in prior.logs}
        self.log_prior = np.array(
            [prior.logs[c.effect.name] - np.log(self.shapes[c.effect.name]) for c in self.candidates]
        )
        columns = np.concatenate([[0], *(c.columns + 1 for c in self.candidates)]).astype(int)
        rest = problem.generic[len(problem.ridge) :] + 1
        widths = [len(c.columns) for c in self.candidates]
        ends = 1 + np.cumsum([0, *widths])
        self.index = [np.arange(ends[k], ends[k + 1]) for k in range(len(self.candidates))]
        self.left, self.base = _beside_remainder(total, columns, rest, policy)

    def search(self, most: int) -> list[tuple[tuple[int, ...], float]]:
        """Return sets of candidates with their logarithms, the best first."""
        shares = np.log(size_prior(self.policy))
        scores = {(): self.base.copy()}
        level: list[tuple[int, ...]] = [()]
        for _ in range(most):
            fresh: dict[tuple[int, ...], np.ndarray] = {}
            for key in level:
                more = self._increments(key)
                called = {self.candidates[k].called for k in key}
                for k, candidate in enumerate(self.candidates):
                    extended = tuple(sorted((*key, k)))
                    if candidate.called in called or k in key:
                        continue
                    value = scores[key] + more[k] + self.log_prior[k]
                    if extended not in fresh or value.max() > fresh[extended].max():
                        fresh[extended] = value
            scores.update(fresh)
            order = sorted(fresh, key=lambda key: -_total(fresh[key] + shares))
            level = self._kept(order)
            if not level:
                break
        ranked = [(key, _total(value + shares)) for key, value in scores.items()]
        best: dict[tuple[str, ...], tuple[tuple[int, ...], float]] = {}
        for key, log in sorted(ranked, key=lambda item: -item[1]):
            best.setdefault(tuple(sorted(self.candidates[k].effect.name for k in key)), (key, log))
        return list(best.values())

    def _kept(self, order: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
        """Return sets that go on: of each set of mechanisms the best few shapes."""
        seen: dict[tuple[str, ...], int] = {}
        level = []
        for key in order:
            name = tuple(sorted(self.candidates[k].called for k in key))
            if seen.get(name, 0) < self.policy.shapes:
                seen[name] = seen.get(name, 0) + 1
                level.append(key)
            if len(level) >= self.policy.beam:
                break
        return level

    def _increments(self, key: Sequence[int]) -> np.ndarray:
        """Return by how much each candidate raises a set's log-evidence, shape (candidates, sizes)."""
        inside = np.concatenate([self.index[k] for k in key]).astype(int) if key else np.zeros(0, dtype=int)
        single = np.array([k for k, own in enumerate(self.index) if len(own) == 1], dtype=int)
        columns = np.array([self.index[k][0] for k in single], dtype=int)
        low = np.array([self.candidates[k].low[0] for k in single])
        high = np.array([self.candidates[k].high[0] for k in single])
        result = np.full((len(self.candidates), len(self.left)), -np.inf)
        for size, gram in enumerate(self.left):
            rest = gram
            if len(inside):
                matrix = gram[np.ix_(inside, inside)] + np.eye(len(inside))
                rest = gram - gram[:, inside] @ np.linalg.solve(matrix, gram[inside])
            information, score = np.maximum(rest[columns, columns], 0.0), rest[columns, 0]
            value = np.clip(score / (information + 1), low, high)
            result[single, size] = score * value - 0.5 * (information + 1) * value**2 - 0.5 * np.log1p(information)
            for k in set(range(len(self.index))) - set(single.tolist()):
                own = self.index[k]
                result[k, size] = self._several(rest[np.ix_(own, own)], rest[own, 0])
        return result

    def _several(self, information: np.ndarray, score: np.ndarray) -> float:
        """Return the log-evidence of columns with a common width of their prior, which is summed over."""
        power, axes = np.linalg.eigh(information)
        power, turned = np.maximum(power, 0.0), np.square(axes.T @ score)
        variance = np.square(self.policy.scales)[:, None]
        each = 0.5 * (turned * variance / (1 + variance * power) - np.log1p(variance * power)).sum(axis=1)
        return _total(each) - float(np.log(len(each)))

    def placed(self, key: Sequence[int]) -> list[Placed]:
        """Return a set's effects with the numbers that fit best to first order, inside their bounds."""
        if not key:
            return []
        columns = np.concatenate([self.index[k] for k in key])
        low = np.minimum(np.concatenate([self.candidates[k].low for k in key]), -1e-12)
        high = np.maximum(np.concatenate([self.candidates[k].high for k in key]), 1e-12)
        gram = self.left[0]
        matrix = gram[np.ix_(columns, columns)] + 0.05 * np.eye(len(columns))
        values = bounded(matrix, gram[columns, 0], low, high)
        made, at = [], 0
        for k in key:
            width = len(self.index[k])
            channels = self.problem.setting.course.channels
            made.append(self.candidates[k].placed(values[at : at + width], channels))
            at += width
        return made


def _beside_remainder(
    total: np.ndarray, columns: np.ndarray, rest: np.ndarray, policy: Policy
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the Gram matrix of columns beside a remainder of each size, and that remainder's own log-evidence."""
    information = total[np.ix_(rest, rest)]
    largest = max(float(np.diag(information).max(initial=0.0)), 1e-9)
    few = total[np.ix_(columns, columns)]
    left, base = [], []
    for size in policy.sizes:
        if size == 0 or not len(rest):
            left.append(few)
            base.append(0.0)
            continue
        variance = size**2 / largest
        matrix = np.eye(len(rest)) / variance + information
        through = np.linalg.solve(matrix, total[np.ix_(rest, columns)])
        left.append(few - total[np.ix_(columns, rest)] @ through)
        log = np.linalg.slogdet(np.eye(len(rest)) + variance * information)[1]
        base.append(-0.5 * log + 0.5 * float(total[0, rest] @ through[:, 0]))
    return left, np.array(base)


def _total(values: np.ndarray) -> float:
    """Return the logarithm of a sum of exponentials."""
    top = float(values.max())
    return top + float(np.log(np.exp(values - top).sum()))
