"""Leftovers: how much of the residual anything could still predict, in episodes that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.noise.noise_model import Noise
from tacdata.discrepancy.noise.whitener import Whitener
from tacdata.discrepancy.regressors.generic import histories
from tacdata.discrepancy.search.fits import fitted
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated, gains, solve, t_value


@dataclass(frozen=True)
class Leftovers:
    """Part of held-out episodes that columns of no effect still predict (five-fold cross-validation)."""

    gain: float
    """Fall of half the whitened sum of squares, held out, summed over episodes [1]; 0 or more."""
    t: float
    """Its mean over episodes, in standard errors [1]."""


def leftovers(problem: Problem) -> Leftovers:
    """Say how much of the residual is still predictable by anything."""
    best = Leftovers(0.0, 0.0)
    fixed = np.concatenate([problem.nuisances, problem.tangent.columns]).astype(int)
    ridge = np.concatenate([problem.ridge, np.full(len(problem.tangent.columns), 1.0)])
    gram = eliminated(problem.grams.gram, fixed, ridge)
    everything = np.concatenate([*(c.columns for c in problem.candidates), problem.generic]).astype(int)
    for columns in (problem.generic, everything):
        scale = float(np.mean([gram[:, c + 1, c + 1].sum() for c in columns]))
        for strength in (1e-4, 1e-2, 1e-1, 1.0):
            each = _ridge_gains(problem, gram, columns, strength * scale)
            if each.sum() > best.gain:
                best = Leftovers(float(each.sum()), t_value(each))
    # The columns so far are patterns common to all streams. Each stream may still follow the path in its own way.
    residual, remembered = _stream_residual(problem), own_histories(problem)
    for strength in (1e-3, 1e-2, 1e-1, 1.0):
        each = _stream_gains(problem, residual, remembered, strength)
        if each.sum() > best.gain:
            best = Leftovers(float(each.sum()), t_value(each))
    return best


def _stream_residual(problem: Problem) -> np.ndarray:
    """Return the whitened residual with nuisances fitted, shape (m, streams)."""
    null = problem.null
    residual = null.whitener.whitened(problem.board.columns[0][:, :, None])[:, :, 0]
    if len(problem.nuisances):
        _, values = fitted(problem, [], np.arange(len(problem.folds)))
        weights = values[len(problem.tangent.columns) + len(problem.model_errors) :].astype(np.float32)
        residual = residual - null.nuisances @ weights
    return residual


def _stream_gains(problem: Problem, residual: np.ndarray, columns: np.ndarray, strength: float) -> np.ndarray:
    """Return held-out gains of histories with weights of their own in every stream, shape (episodes,)."""
    course = problem.setting.course.reduced
    weight = strength * float(np.mean(np.einsum("ij,ij->j", columns, columns)))
    result = np.zeros(len(problem.folds))
    if weight <= 0:
        return result  # a path at rest has no history
    for fold in np.unique(problem.folds):
        train = problem.folds[course.episode] != fold
        matrix = columns[train].T @ columns[train] + weight * np.eye(columns.shape[1])
        values = np.linalg.solve(matrix, columns[train].T @ residual[train])
        predicted = columns[~train] @ values
        gain = np.sum(predicted * residual[~train] - 0.5 * predicted**2, axis=1)
        result += np.bincount(course.episode[~train], gain, minlength=len(result))
    return result


def own_histories(problem: Problem) -> np.ndarray:
    """Return the histories of a path, alone and times depth, whitened and without nuisances, shape (m, k)."""
    null, course = problem.null, problem.setting.course
    path_histories = histories(course)[course.read]
    depth = course.reduced.tip[:, 2]
    share = np.clip((depth - max(0.0, float(depth.min()))) / course.span, 0, 1)[:, None]
    columns = np.column_stack([path_histories * np.minimum(share * 10, 1), path_histories * share])[:, None, :]
    plain = Noise(np.ones(1), null.noise.memory, null.noise.step, null.noise.offsets)
    none = np.zeros((len(depth), 1, 1))
    white = Whitener(course.reduced, plain, null.context, null.features, none).whitened(columns)[:, 0].astype(float)
    return white / np.maximum(np.sqrt(np.mean(white**2, axis=0)), 1e-9)


def _ridge_gains(problem: Problem, gram: np.ndarray, columns: np.ndarray, weight: float) -> np.ndarray:
    unbounded = np.full(len(columns), np.inf)
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train, test = problem.folds != fold, problem.folds == fold
        values = solve(gram[train].sum(axis=0), columns, np.full(len(columns), weight), -unbounded, unbounded)
        result[test] = gains(gram[test], columns, values)
    return result
