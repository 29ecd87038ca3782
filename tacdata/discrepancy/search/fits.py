"""Fits of candidates to the Gram matrices: to all episodes, to some, and to all but one fold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.discrepancy.regressors.candidates import Candidate
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import gains, solve

INFORMED = 3.0
"""A channel's gain is estimated if presses have so many times its prior's information [1]."""


def fitted(problem: Problem, chosen: Sequence[Candidate], episodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit some candidates, with nuisances and what is placed, to some episodes.

    Returns:
        Columns (from 0) and their coefficients; the candidates' first.
    """
    own = [c.columns for c in chosen]
    moving = problem.tangent
    columns = np.concatenate([*own, moving.columns, problem.model_errors, problem.nuisances]).astype(int)
    wide = sum(map(len, own))
    rooms = [k.room(problem.placed) for k in moving.knobs]
    free = np.full(len(problem.model_errors) + len(problem.nuisances), np.inf)
    low = np.concatenate([*(c.low for c in chosen), [r[0] for r in rooms], -free])
    high = np.concatenate([*(c.high for c in chosen), [r[1] for r in rooms], free])
    weak, tight = np.full(wide, 1e-6), np.ones(len(rooms) + len(problem.model_errors))
    ridge = np.concatenate([weak, tight, problem.ridge])
    low, high = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    return columns, solve(problem.grams.of(episodes), columns, ridge, low, high)


def held_out(problem: Problem, chosen: Sequence[Candidate]) -> np.ndarray:
    """Return each episode's gain over the model as it is, fitted to the other folds, shape (episodes,)."""
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train, rest = np.flatnonzero(problem.folds != fold), np.flatnonzero(problem.folds == fold)
        columns, values = fitted(problem, chosen, train)
        empty, start = fitted(problem, [], train)
        gram = problem.grams.gram[rest]
        result[rest] = gains(gram, columns, values) - gains(gram, empty, start)
    return result


def best_shapes(problem: Problem, among: np.ndarray | None = None) -> dict[str, Candidate]:
    """Return each effect's candidate with the largest gain in a fit with its bounds."""
    everything = np.arange(len(problem.folds)) if among is None else among
    best: dict[str, tuple[float, Candidate]] = {}
    for candidate, gain in zip(problem.candidates, shape_gains(problem, everything), strict=True):
        name = candidate.effect.name
        if name not in best or gain > best[name][0]:
            best[name] = gain, candidate
    return {name: candidate for name, (_, candidate) in best.items()}


def shape_gains(problem: Problem, among: np.ndarray) -> list[float]:
    """Return by how much each candidate lowers half the sum of squares of some episodes, in a fit with its bounds."""
    total = problem.grams.of(among)[None]
    return [float(gains(total, *fitted(problem, [candidate], among))[0]) for candidate in problem.candidates]


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
    own = values[first : first + channels] * effect.amplitudes[0].typical
    information = np.diag(problem.grams.of(everything))[problem.nuisances[:channels] + 1]
    return np.where(information > INFORMED * problem.ridge[:channels], own, np.nan)


def gains_of_halves(problem: Problem) -> np.ndarray:
    """Return the channels' gains in the first and the second half of the session [1], shape (2, channels)."""
    halves = np.array_split(np.arange(len(problem.folds)), 2)
    return np.stack([channel_gains(problem, half) for half in halves])
