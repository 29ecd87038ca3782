"""Which contact law the readings of a foreign skin follow, by episodes that were left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from tacdata.chain import Course
from tacdata.discrepancy.model.fitted_response import contexts
from tacdata.discrepancy.model.laws.law import ContactLaw, laws
from tacdata.discrepancy.statistics.gram_fit import FOLDS, fold_of

TOUCHES = np.linspace(-0.05, 0.1, 7)
"""Where the skin may begin, below what the recordings say [stroke]."""
INTERVALS = 12
"""Of the splines that laws are held against."""
RIDGE = 1e-9
"""Share of the mean diagonal added to it."""
FEWEST = 2 * FOLDS
"""Fewer episodes say nothing of it."""
FOLLOWS = 0.05
"""A law that leaves more of the change of the readings is none worth telling [1]."""


@dataclass(frozen=True)
class ResponseCurve:
    """The contact law that follows best, and splines beside it."""

    law: ContactLaw
    shape: float
    """Its own number [1]."""
    left: float
    """Share of the readings' change in left-out episodes that it does not follow [1]."""
    splines: float
    """The same of splines [1]."""

    def __str__(self) -> str:
        """Return it in words."""
        better = "no worse" if self.left <= self.splines else f"splines leave {100 * self.splines:.2g} %"
        return (
            f"of the contact laws, {self.law.said(self.shape)} follows best: held out, it leaves "
            f"{100 * self.left:.2g} % of the readings' change, {better}"
        )


def response_curve(course: Course) -> ResponseCurve | None:
    """Return the law that predicts left-out episodes best; None where none follows, or episodes are few."""
    reduced = course.reduced
    whole = np.isfinite(reduced.readings).all(axis=1)
    episode, kept = np.unique(reduced.episode[whole], return_inverse=True)
    if len(episode) < FEWEST:
        return None
    place = np.zeros(len(episode), dtype=np.int64)
    place[kept] = contexts(reduced)[whole]
    change = _centred(reduced.readings[whole], kept)
    depth = reduced.tip[whole, 2] / course.stroke
    found = [(law, *_held_out(law, depth, change, kept, place)) for law in laws()]
    law, shape, left = min(found, key=lambda one: one[2])
    if left > FOLLOWS:
        return None
    return ResponseCurve(law, shape, left, _splines(depth, change, kept, place))


def _centred(values: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Return values, shape (n, k), less their mean in each episode."""
    sums = np.zeros((int(episode.max()) + 1, values.shape[1]))
    np.add.at(sums, episode, values)
    return values - (sums / np.bincount(episode)[:, None])[episode]


def _held_out(
    law: ContactLaw, depth: np.ndarray, change: np.ndarray, episode: np.ndarray, place: np.ndarray
) -> tuple[float, float]:
    """Return the shape that most folds choose, and the share of the change that the law leaves of left-out episodes."""
    grid = [(touch, shape) for touch in TOUCHES for shape in law.shapes]
    columns = np.stack([_risen(law, depth - touch, shape) for touch, shape in grid], axis=1)
    columns = _centred(columns, episode)
    count, all_of = len(place), np.square(change)
    own, with_change = np.zeros((count, len(grid))), np.zeros((count, len(grid), change.shape[1]))
    power = np.zeros((count, change.shape[1]))
    for e in range(count):
        rows = episode == e
        own[e], power[e] = np.square(columns[rows]).sum(axis=0), all_of[rows].sum(axis=0)
        with_change[e] = columns[rows].T @ change[rows]
    folds, left, chosen = fold_of(count), 0.0, []
    for fold in np.unique(folds):
        train, test = folds != fold, folds == fold
        fits, misses = np.zeros(len(grid)), np.zeros(len(grid))
        for p in np.unique(place):
            a, b = train & (place == p), test & (place == p)
            factor = with_change[a].sum(axis=0) / np.maximum(own[a].sum(axis=0), 1e-300)[:, None]
            fits += (factor * with_change[a].sum(axis=0)).sum(axis=1)
            square = np.square(factor) * own[b].sum(axis=0)[:, None]
            misses += power[b].sum() + (square - 2 * factor * with_change[b].sum(axis=0)).sum(axis=1)
        best = int(np.argmax(fits))
        left += float(misses[best])
        chosen.append(grid[best][1])
    return float(np.median(chosen)), left / max(float(power.sum()), 1e-300)


def _risen(law: ContactLaw, depth: np.ndarray, shape: float) -> np.ndarray:
    """Return a law's rise over the largest, 0 in the air."""
    share = np.maximum(depth, 0.0)
    rise = law.rise(share / max(float(share.max()), 1e-12), shape)
    return rise / max(float(rise.max()), 1e-12)


def _splines(depth: np.ndarray, change: np.ndarray, episode: np.ndarray, place: np.ndarray) -> float:
    """Return the share of the change that splines leave of left-out episodes."""
    inner = np.linspace(float(depth.min()), float(depth.max()) + 1e-9, INTERVALS + 1)
    basis = BSpline.design_matrix(depth, np.r_[[inner[0]] * 3, inner, [inner[-1]] * 3], 3).toarray()
    columns = _centred(basis, episode)
    folds, left = fold_of(len(place)), 0.0
    for fold in np.unique(folds):
        for p in np.unique(place):
            own = place[episode] == p
            train, test = own & (folds[episode] != fold), own & (folds[episode] == fold)
            gram = columns[train].T @ columns[train]
            gram = gram + RIDGE * max(float(np.trace(gram)) / len(gram), 1e-300) * np.eye(len(gram))
            weights = np.linalg.solve(gram, columns[train].T @ change[train])
            left += float(np.square(change[test] - columns[test] @ weights).sum())
    return left / max(float(np.square(change).sum()), 1e-300)
