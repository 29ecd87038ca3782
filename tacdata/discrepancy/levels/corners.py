"""The corner in which an effect lives: presses of one rate or one place, one range of depth.

An effect of the whole machine has one size everywhere. All readings together are its best evidence. A fault of one
place is absent elsewhere. So is a fault of fast motion. Its corner alone is its best evidence. Presses elsewhere add
only noise. A test over all presses hardly sees it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.tip_motion import speeds
from tacdata.discrepancy.noise.gram import episode_grams
from tacdata.discrepancy.regressors.candidates import Candidate, build
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated
from tacdata.effects import Placed

FEWEST = 5
"""Presses of a corner, at least."""
MOST_PLACES = 12
"""Places that are compared, at most."""
MOST_COLUMNS = 3
"""Effects with more columns are not confined: a number for each channel fits anything in a few presses."""
STEP = 1.25
"""Rates of press that differ by a larger factor are two [1]."""
MOST_RATES = 5
"""Rates of press that are compared, at most."""
LARGEST = 6.0
"""Largest log-likelihood ratio that one press contributes [1]."""
EVIDENCE = 24.0
"""Least log-likelihood ratio of a corner over the best effect of all presses, each press predicted by the others [1].

Worlds without an effect hold up to 5 (nine, seed 98000) and 7 (forty drawn afterwards, seed 112000).
"""
REFINED = 3
"""Effects that are compared by depth: those with the most evidence."""
THIRDS = ("shallow", "middle", "deep")


@dataclass(frozen=True)
class Corner:
    """An effect, and where it lives."""

    placed: Placed
    """The effect with its size there."""
    depth: str = ""
    """Range of depth; empty for all."""
    rate: str = ""
    """Rate of pressing; empty for all."""
    place: str = ""
    """Place; empty for all."""

    @property
    def words(self) -> str:
        """The corner in words."""
        return ", ".join(part for part in (self.depth, self.rate, self.place) if part)

    @property
    def seen(self) -> str:
        """A clause on the corner and the effect."""
        return f"{self.words}: readings change as by {self.placed.effect.spoken}, and hardly elsewhere"

    @property
    def alarm(self) -> Alarm:
        """Its alarm, where no effect of all presses is found."""
        return Alarm(f"in one corner alone, {self.seen}", "press there again, and next to it, at the same rates")


@dataclass(frozen=True)
class _Best:
    """A candidate in the part of the presses where it has the most evidence."""

    candidate: Candidate
    coefficients: np.ndarray
    gain: float
    part: int
    third: int | None
    ratios: np.ndarray
    """Log-likelihood ratio of each press over nothing [1], shape (presses,)."""


def corner(problem: Problem, explained: float = 0.0) -> Corner | None:
    """Return the effect with the most evidence over any effect of all presses, and its corner; None if too little.

    Args:
        problem: The model as it was given, with all candidates.
        explained: By how much the answer of all presses lowers half the sum of squares: a corner explains more [1].
    """
    course = problem.setting.course
    parts = list(_parts(course))
    masks = np.array([presses for _, presses in parts], dtype=float)
    gram = eliminated(problem.grams.gram, problem.fixed, problem.fixed_ridge(0.0))
    # Poses and offsets wander: at the place that wanders most, that resembles an effect that follows the clock.
    candidates = [c for c in problem.candidates if len(c.columns) <= MOST_COLUMNS and not c.effect.follows_clock]
    fits = [(c, *_fitted(gram, c, c.columns, masks)) for c in candidates]
    if not fits:
        return None
    best: dict[str, tuple[float, Candidate]] = {}
    for c, _, gains in fits:
        best[c.called] = max(best.get(c.called, (0.0, c)), (float(gains.max()), c), key=lambda item: item[0])
    chosen = [c for _, c in sorted(best.values(), key=lambda item: -item[0])[:REFINED]]
    everywhere = max(fits, key=lambda fit: fit[2][0])[0]
    rival = _predicted(gram, everywhere, everywhere.columns, masks[0])
    depth = course.reduced.tip[:, 2]
    edges = np.append(0.0, np.quantile(depth[depth > 0], [1 / 3, 2 / 3, 1])) if np.any(depth > 0) else np.zeros(4)
    third = np.clip(np.searchsorted(edges, depth, side="right") - 1, 0, len(THIRDS) - 1)
    corners = [fit for fit in _by_depth(problem, chosen, third, masks) if fit.third is not None or fit.part > 0]
    if not corners:
        return None
    found = max(corners, key=lambda fit: _bounded(fit.ratios - rival))
    # Of so many corners and effects, noise prefers one by the logarithm of their number.
    searched = np.log(len(parts) * (1 + len(THIRDS)) * len(best))
    if _bounded(found.ratios - rival) < EVIDENCE or _bounded(found.ratios) < searched or found.gain < explained:
        return None
    k = found.third
    name = "" if k is None else f"{THIRDS[k]} ({edges[k]:.2g} to {edges[k + 1]:.2g} mm)"
    placed = found.candidate.placed(found.coefficients, course.channels)
    return Corner(placed, name, *parts[found.part][0])


def _by_depth(problem: Problem, candidates: list[Candidate], third: np.ndarray, masks: np.ndarray) -> Iterator[_Best]:
    """Yield candidates where they have the most evidence, in all depths and in each third."""
    setting, placed = problem.setting, [*problem.setting.given, *problem.placed]
    forms = {c.form for c in candidates}
    board = build(setting.course, setting.response, placed, setting.effects, setting.absorbed, forms)
    whitener = problem.null.whitener_for(setting, placed)
    for candidate in board.candidates:
        columns = [problem.board.columns[0]]
        columns += [board.columns[1 + c] * (third == k)[:, None] for k in range(len(THIRDS)) for c in candidate.columns]
        white = whitener.whitened(np.stack(columns, axis=2).astype(np.float32))
        gram = episode_grams(white, setting.course.reduced, problem.null.nuisances, problem.null.inner).gram
        gram = eliminated(gram, np.arange(len(columns) - 1, gram.shape[1] - 1), problem.ridge)
        for k in (None, *range(len(THIRDS))):
            joined, index = _joined(gram, len(candidate.columns), k), np.arange(len(candidate.columns))
            coefficients, gains = _fitted(joined, candidate, index, masks)
            part = int(np.argmax(gains))
            ratios = _predicted(joined, candidate, index, masks[part])
            yield _Best(candidate, coefficients[part], float(gains[part]), part, k, ratios)


def _joined(gram: np.ndarray, width: int, third: int | None) -> np.ndarray:
    """Return Gram matrices of the residual and a candidate's columns in one third of the depth; None joins all."""
    thirds = range(len(THIRDS)) if third is None else (third,)
    by = np.zeros((gram.shape[1], 1 + width))
    by[0, 0] = 1.0
    for k, c in product(thirds, range(width)):
        by[1 + k * width + c, 1 + c] = 1.0
    return by.T @ gram @ by


def _fitted(
    gram: np.ndarray, candidate: Candidate, columns: np.ndarray, masks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a candidate's coefficients in each part of the presses, and the fall of half the sum of squares.

    Args:
        gram: Of each press, residual first, shape (presses, 1 + p, 1 + p).
        candidate: Whose bounds hold.
        columns: Its columns, from 0, shape (k,).
        masks: Presses of each part, 1 or 0, shape (parts, presses).
    """
    index = columns + 1
    score = masks @ gram[:, 0, index]
    total = np.einsum("pe,eij->pij", masks, gram[:, index[:, None], index])
    values = np.clip(_solved(total, score), np.minimum(candidate.low, 0.0), np.maximum(candidate.high, 0.0))
    return values, np.einsum("pi,pi->p", values, score) - 0.5 * np.einsum("pi,pij,pj->p", values, total, values)


def _predicted(gram: np.ndarray, candidate: Candidate, columns: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the log-likelihood ratio of each press over nothing [1], shape (presses,); 0 outside the mask.

    Each press is predicted by the others: noise, and one odd press, have no evidence.
    """
    index, own = columns + 1, np.flatnonzero(mask)
    score, each = gram[own[:, None], 0, index], gram[own[:, None, None], index[:, None], index]
    others = _solved(each.sum(axis=0) - each, score.sum(axis=0) - score)
    others = np.clip(others, np.minimum(candidate.low, 0.0), np.maximum(candidate.high, 0.0))
    ratios = np.zeros(len(gram))
    ratios[own] = np.einsum("ei,ei->e", others, score) - 0.5 * np.einsum("ei,eij,ej->e", others, each, others)
    return ratios


def _bounded(ratios: np.ndarray) -> float:
    """Return the sum over presses of log-likelihood ratios, each bounded [1]."""
    return float(np.clip(ratios, -LARGEST, LARGEST).sum())


def _solved(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the solution of each of some small systems; 0 where a column is nothing."""
    jitter = 1e-6 * np.trace(matrices, axis1=1, axis2=2) + 1e-9
    return np.linalg.solve(matrices + jitter[:, None, None] * np.eye(matrices.shape[1]), vectors[:, :, None])[:, :, 0]


def _parts(course: Course) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
    """Yield the presses of each rate and place, of all rates and of all places, with their words."""
    everything = np.ones(course.episodes, dtype=bool)
    for (rate, at_rate), (place, at_place) in product(
        [("", everything), *_rates(course)],
        [("", everything), *((f"at {name}", presses) for name, presses in places(course))],
    ):
        if np.count_nonzero(at_rate & at_place) >= FEWEST or not (rate or place):
            yield (rate, place), at_rate & at_place


def _rates(course: Course) -> list[tuple[str, np.ndarray]]:
    """Return the presses of each rate; none of a single rate."""
    rates = speeds(course)[0]
    if len(rates) != course.episodes or not np.isfinite(rates).all():
        return []
    order = np.sort(rates)
    edges = order[1:][order[1:] > STEP * order[:-1]]
    if len(edges) >= MOST_RATES:
        edges = np.quantile(rates, [1 / 3, 2 / 3])
    label = np.searchsorted(edges, rates, side="right")
    groups = [label == k for k in range(len(edges) + 1)]
    return [(f"presses at {np.median(rates[g]):.2g} mm/s", g) for g in groups if len(edges) and g.any()]


def places(course: Course) -> list[tuple[str, np.ndarray]]:
    """Return the name and the presses of each place.

    None of a single place. None of many places.
    """
    numbers = np.unique(course.site)
    if not 1 < len(numbers) <= MOST_PLACES:
        return []
    found = []
    for number in numbers:
        presses = course.site == number
        rows = np.flatnonzero(presses[course.episode])
        x, y = course.tip[rows[np.argmax(course.tip[rows, 2])], :2]
        specimen = course.specimens[int(np.flatnonzero(presses)[0])] if course.specimens else ""
        found.append((specimen or f"({x:.2g}, {y:.2g}) mm", presses))
    return found
