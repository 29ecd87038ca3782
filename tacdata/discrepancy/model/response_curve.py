"""Which contact law the readings of a foreign skin follow, by episodes that were left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from tacdata.chain import Course
from tacdata.discrepancy.model.contexts import contexts
from tacdata.discrepancy.model.laws.law import ContactLaw, laws
from tacdata.discrepancy.statistics.gram_fit import FOLDS, fold_of

TOUCHES = np.linspace(-0.05, 0.1, 7)
"""Where the skin may begin, below the recorded depth [stroke]."""
INTERVALS = (6, 12, 25, 50)
"""Intervals of the splines that laws are compared with."""
RIDGE = 1e-9
"""Share of the mean diagonal added to it."""
FEWEST = 2 * FOLDS
"""Fewer episodes say nothing of it."""
EACH = 3
"""Fewer episodes of a place say nothing of it."""
DEEPER = 0.02
"""Episodes deeper than those fitted to by more are not asked [1]."""
FOLLOWS = 0.05
"""Share of the readings' change that a law may leave unexplained [1]."""
MIDDLE = (0.1, 0.9)
"""Quantiles of the channels' numbers that are reported [1]."""


@dataclass(frozen=True)
class ResponseCurve:
    """The contact law that follows best, and splines for comparison."""

    law: ContactLaw
    numbers: tuple[float, float]
    """Its own number, of most channels and places: from, to [1]."""
    left: float
    """Share of the readings' change in left-out episodes that it does not follow [1]."""
    splines: float
    """The same of splines [1]."""
    worse: bool
    """Whether that is more than splines leave, by more than one standard error over episodes."""

    def __str__(self) -> str:
        """Return it in words."""
        better = "" if self.worse else ", no better"
        return (
            f"the contact law is closest to {self.law.said(*self.numbers)}: in presses left out it misses "
            f"{_percent(self.left)} of the readings' change (the splines of the base: {_percent(self.splines)}{better})"
        )


def response_curve(course: Course) -> ResponseCurve | None:
    """Return the law that predicts left-out episodes best; None where none follows, or episodes are few.

    Each channel and place has a factor and a number of its own. A law without such a number goes before one that has
    it and is better by less than one standard error over episodes.
    """
    places = list(_places(course))
    if sum(len(place.asked) for place in places) < FEWEST:
        return None
    power = sum(float(np.square(place.change[place.folds >= 0]).sum()) for place in places)
    tried = [_held_out(law, places) for law in laws()]
    best = min((residuals for _, _, residuals in tried), key=np.sum)
    law, numbers, residuals = min(
        (trial for trial in tried if not _worse(trial[2], best)),
        # Of laws that predict equally well the one with fewer numbers.
        key=lambda trial: (len(trial[0].shapes) > 1, trial[2].sum()),
    )
    if float(residuals.sum()) > FOLLOWS * power:
        return None
    splines = min((np.concatenate([_splines(place, n) for place in places]) for n in INTERVALS), key=np.sum)
    low, high = np.quantile(numbers, MIDDLE, method="nearest")
    share = max(power, 1e-300)
    return ResponseCurve(
        law,
        (float(low), float(high)),
        float(residuals.sum()) / share,
        float(splines.sum()) / share,
        _worse(residuals, splines),
    )


@dataclass(frozen=True)
class _Place:
    """Rows of one place and tool."""

    depth: np.ndarray
    """[stroke], shape (n,)."""
    change: np.ndarray
    """Readings less their mean in each episode, shape (n, channels)."""
    episode: np.ndarray
    """Counted from 0, shape (n,), int64."""
    folds: np.ndarray
    """Fold in which each row is asked, -1 in none, shape (n,), int64."""

    @property
    def asked(self) -> np.ndarray:
        """Episodes that are asked, shape (k,), int64."""
        return np.unique(self.episode[self.folds >= 0])


def _places(course: Course) -> Iterator[_Place]:
    """Give the places of a course whose episodes tell a law."""
    reduced = course.reduced
    complete = np.isfinite(reduced.readings).all(axis=1)
    context = contexts(reduced)
    for number in np.unique(context):
        rows = complete & (context == number)
        _, episode = np.unique(reduced.episode[rows], return_inverse=True)
        count = int(episode.max(initial=-1)) + 1
        if count < EACH:
            continue
        depth, deepest = reduced.tip[rows, 2] / course.stroke, np.full(count, -np.inf)
        np.maximum.at(deepest, episode, depth)
        folds = fold_of(count)
        # In a press deeper than all those fitted to, extrapolation would be compared, not the law.
        reach = np.array([deepest[folds != fold].max() for fold in folds])
        folds = np.where(deepest <= reach + DEEPER * np.abs(reach), folds, -1)
        yield _Place(depth, _centred(reduced.readings[rows], episode), episode, folds[episode])


def _centred(values: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Return values, shape (n, k), less their mean in each episode."""
    sums = np.zeros((int(episode.max()) + 1, values.shape[1]))
    np.add.at(sums, episode, values)
    return values - (sums / np.bincount(episode)[:, None])[episode]


def _worse(residuals: np.ndarray, best: np.ndarray) -> bool:
    """Return whether more is left of episodes than by the best, by over one standard error, shapes (episodes,)."""
    more = residuals - best
    return float(more.mean()) > float(more.std(ddof=1) / np.sqrt(len(more)))


def _held_out(law: ContactLaw, places: list[_Place]) -> tuple[ContactLaw, np.ndarray, np.ndarray]:
    """Return a law, its number in each channel of each place, and its residual of each left-out episode."""
    grid = [(touch, shape) for touch in TOUCHES for shape in law.shapes]
    shapes, numbers, all_residuals = np.array([shape for _, shape in grid]), [], []
    for place in places:
        columns = np.stack([_risen(law, place.depth - touch, shape) for touch, shape in grid], axis=1)
        columns, channels = _centred(columns, place.episode), np.arange(place.change.shape[1])
        residuals, choices = np.zeros(int(place.episode.max()) + 1), []
        for fold in np.unique(place.folds[place.folds >= 0]):
            mask = place.folds == fold
            power = np.square(columns[~mask]).sum(axis=0)[:, None]
            # A gain for each channel has a closed form, so that only touch and shape need a grid.
            factor = columns[~mask].T @ place.change[~mask] / np.maximum(power, 1e-300)
            at = np.argmax(np.square(factor) * power, axis=0)
            missed = place.change[mask] - columns[mask][:, at] * factor[at, channels]
            residuals += np.bincount(place.episode[mask], np.square(missed).sum(axis=1), minlength=len(residuals))
            choices.append(shapes[at])
        all_residuals.append(residuals[place.asked])
        numbers.append(np.median(choices, axis=0) if choices else np.zeros(0))
    return law, np.concatenate(numbers), np.concatenate(all_residuals)


def _risen(law: ContactLaw, depth: np.ndarray, shape: float) -> np.ndarray:
    """Return a law's rise over the largest, 0 in the air."""
    share = np.maximum(depth, 0.0)
    rise = law.rise(share / max(float(share.max()), 1e-12), shape)
    return rise / max(float(rise.max()), 1e-12)


def _splines(place: _Place, intervals: int) -> np.ndarray:
    """Return the splines' residual of each left-out episode, shape (episodes asked,)."""
    residuals = np.zeros(int(place.episode.max()) + 1)
    for fold in np.unique(place.folds[place.folds >= 0]):
        mask = place.folds == fold
        low, high = float(place.depth[~mask].min()), float(place.depth[~mask].max()) + 1e-9
        knots = np.r_[[low] * 3, np.linspace(low, high, intervals + 1), [high] * 3]
        basis = BSpline.design_matrix(np.clip(place.depth, low, high), knots, 3).toarray()
        columns = _centred(basis, place.episode)
        gram = columns[~mask].T @ columns[~mask]
        # B-splines sum to 1, centred ones to 0: without a ridge the matrix is singular.
        gram = gram + RIDGE * max(float(np.trace(gram)) / len(gram), 1e-300) * np.eye(len(gram))
        missed = place.change[mask] - columns[mask] @ np.linalg.solve(gram, columns[~mask].T @ place.change[~mask])
        residuals += np.bincount(place.episode[mask], np.square(missed).sum(axis=1), minlength=len(residuals))
    return residuals[place.asked]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
