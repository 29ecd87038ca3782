"""Fits of candidates to the Gram matrices: to all episodes, to some, and to all but one fold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import Beside

INFORMED = 3.0
"""A channel's gain is estimated if presses have so many times its prior's information [1]."""


def fitted(problem: Problem, candidates: Sequence[Candidate], episodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit some candidates, with nuisances and the placed effects, to some episodes.

    Returns:
        Columns (from 0) and their coefficients; the candidates' first.
    """
    unbounded, conditional = _beside(problem, episodes)
    columns, values, unbounded_values = _bounded(problem, conditional, candidates)
    return np.concatenate([columns, unbounded]), np.concatenate([values, unbounded_values])


def gained(
    problem: Problem, candidates: Sequence[Candidate], train: np.ndarray, episodes: np.ndarray | None = None
) -> np.ndarray:
    """Return by how much such a fit lowers half the sum of squares of episodes, shape (episodes,).

    Args:
        problem: The problem.
        candidates: Candidates.
        train: Episodes that are fitted.
        episodes: Those that are looked at; those that are fitted, unless given.
    """
    _, conditional = _beside(problem, train)
    columns, values, _ = _bounded(problem, conditional, candidates)
    return conditional.gains(columns, values, train if episodes is None else episodes)


def _beside(problem: Problem, episodes: np.ndarray) -> tuple[np.ndarray, Beside]:
    """Return the columns without bounds, and the Gram matrices given them."""
    unbounded = np.concatenate([problem.model_errors, problem.nuisances]).astype(int)
    ridge = np.concatenate([np.ones(len(problem.model_errors)), problem.ridge])
    return unbounded, problem.grams.beside(unbounded, ridge, episodes)


def _bounded(
    problem: Problem, conditional: Beside, candidates: Sequence[Candidate]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return columns of candidates and placed effects, their coefficients, and those of columns without bounds."""
    moving, candidate_columns = problem.tangent.columns, [c.columns for c in candidates]
    columns = np.concatenate([*candidate_columns, moving]).astype(int)
    rooms = np.array([k.room(problem.placed) for k in problem.tangent.knobs]).reshape(-1, 2)
    low = np.minimum(np.concatenate([*(c.low for c in candidates), rooms[:, 0]]), -1e-12)
    high = np.maximum(np.concatenate([*(c.high for c in candidates), rooms[:, 1]]), 1e-12)
    ridge = np.concatenate([np.full(len(columns) - len(moving), 1e-6), np.ones(len(moving))])
    return columns, *conditional.fit(columns, ridge, low, high)


def held_out(problem: Problem, candidates: Sequence[Candidate]) -> np.ndarray:
    """Return each episode's gain over the model as it is, fitted to the other folds, shape (episodes,)."""
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train, test = np.flatnonzero(problem.folds != fold), np.flatnonzero(problem.folds == fold)
        result[test] = gained(problem, candidates, train, test) - gained(problem, [], train, test)
    return result


def best_shapes(problem: Problem, gains: Sequence[float] | None = None) -> dict[str, Candidate]:
    """Return each effect's candidate with the largest gain in a fit with its bounds.

    Args:
        problem: The problem.
        gains: `shape_gains`, where they are known.
    """
    best: dict[str, tuple[float, Candidate]] = {}
    for candidate, gain in zip(problem.candidates, shape_gains(problem) if gains is None else gains, strict=True):
        name = candidate.effect.name
        if name not in best or gain > best[name][0]:
            best[name] = gain, candidate
    return {name: candidate for name, (_, candidate) in best.items()}


def shape_gains(problem: Problem) -> list[float]:
    """Return by how much each candidate lowers half the sum of squares of all episodes, in a fit with its bounds."""
    everything = np.arange(len(problem.folds))
    return [float(gained(problem, [candidate], everything).sum()) for candidate in problem.candidates]


def channel_gains(problem: Problem, among: np.ndarray | None = None) -> np.ndarray:
    """Return each channel's gain beyond the response's, as calibration finds it [1], shape (channels,).

    0 where the response is fitted; NaN for channels that these presses do not stir.

    Args:
        problem: With the nuisances of calibration.
        among: Episodes that are used, all unless given.
    """
    channels, effect = problem.setting.course.channels, problem.setting.channel_gain
    if effect is None:
        return np.zeros(channels)
    everything = np.arange(len(problem.folds)) if among is None else among
    _, values = fitted(problem, [], everything)
    first = len(problem.tangent.columns) + len(problem.model_errors)
    channel_values = values[first : first + channels] * effect.amplitudes[0].typical
    information = np.diag(problem.grams.of(everything))[problem.nuisances[:channels] + 1]
    return np.where(information > INFORMED * problem.ridge[:channels], channel_values, np.nan)


def gains_of_halves(problem: Problem) -> np.ndarray:
    """Return the channels' gains in the first and the second half of the session [1], shape (2, channels)."""
    halves = np.array_split(np.arange(len(problem.folds)), 2)
    return np.stack([channel_gains(problem, half) for half in halves])
