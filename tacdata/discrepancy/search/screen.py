"""Which missing effect the residual asks for: tests by how episodes scatter, fits, rivals, leftovers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tacdata.discrepancy.noise.gram import Noise
from tacdata.discrepancy.noise.whitener import Cleaner
from tacdata.discrepancy.regressors.candidates import Candidate, StandIn
from tacdata.discrepancy.regressors.generic import histories
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.cluster_robust import Clustered, Lent, clustered, lent, of_kinds
from tacdata.discrepancy.statistics.gram_fit import eliminated, flips, gains, solve, t_value
from tacdata.effects import Effect

FLIPS = 999
SHOWS = 2.0
"""A candidate beyond so many standard errors may be there: others lend beside it [1]."""
NUMERICS = 0.0002
"""What has no memory and explains less, over what presses add to readings, may be rounding of any table [1]..."""
SPLINES = 0.0005
"""...columns of no effect that explain less may be a fitted response's own errors: of its slope, by which an episode's
depth is told, and where it bends more sharply than splines [1]..."""
LIKE_IT = 3.0
"""...or if it explains less than so many times what it would find in the response's own error [1]."""


@dataclass(frozen=True)
class Tested:
    """What chance says of every candidate."""

    z: np.ndarray
    """Standard score of each candidate [1], shape (candidates,)."""
    p: np.ndarray
    """Share of draws in which any decoy does as well [1], shape (candidates,): corrected for their number."""
    gain: np.ndarray
    """By how much half the whitened energy falls [nats], shape (candidates,)."""
    p_generic: float
    """The same for columns that belong to no effect."""
    lent: dict[bool, Lent | None]
    """What candidates say of how much scores scatter: of those that follow the clock (True), of the others."""


def test(problem: Problem, seed: int = 0) -> Tested:
    """Test every candidate by how the episodes' scores scatter, and all together against decoys.

    Decoys are all candidates again, with the scatter of each episode (or stretch of them) times a normal number in
    place of its score: what candidates have in common stays, whatever memory or tails the noise has.
    """
    gram = eliminated(problem.evidence.gram, problem.fixed, problem.fixed_ridge(0.0))
    normal = np.random.default_rng([seed, 13]).normal(size=(FLIPS, len(gram)))
    scores = [clustered(gram, c.columns) for c in problem.candidates]
    clock = [follows_clock(c.effect) for c in problem.candidates]
    kinds = _lent(problem, scores, clock, "")
    z = np.array([s.score(kinds[own]) for s, own in zip(scores, clock, strict=True)])
    if z.max(initial=0.0) > SHOWS:
        # What is there makes the scores of all that look a little like it scatter: they lend beside it.
        best = problem.candidates[int(np.argmax(z))]
        beside = np.concatenate([problem.fixed, best.columns]).astype(int)
        without = np.concatenate([problem.fixed_ridge(0.0), np.zeros(len(best.columns))])
        rest = eliminated(problem.evidence.gram, beside, without)
        others = [clustered(rest, c.columns) for c in problem.candidates]
        kinds = _lent(problem, others, clock, best.called)
        z = np.array([s.score(kinds[own]) for s, own in zip(scores, clock, strict=True)])
    # The same numbers for all, so that candidates that look alike do so by chance as well.
    chance = np.stack([s.by_chance(normal) for s in scores], axis=1) if scores else np.zeros((FLIPS, 1))
    top = chance.max(axis=1)
    z = np.where([_numerics(problem, gram, c) for c in problem.candidates], np.minimum(z, 0.0), z)
    p = (1 + (top[:, None] >= z).sum(axis=0)) / (FLIPS + 1) if problem.setting.decoys else ndtr(-z)
    gain = np.array([0.5 * float(np.sum(np.square(s.pull))) for s in scores])
    return Tested(z, p, gain, _test_generic(problem, gram, seed, top), kinds)


def _lent(problem: Problem, scores: list[Clustered], clock: list[bool], but: str) -> dict[bool, Lent | None]:
    """Return what effects that follow the clock (True), and others, lend each other; one mechanism does not."""
    told: dict[bool, dict[str, list[Clustered]]] = {False: {}, True: {}}
    for candidate, score, own in zip(problem.candidates, scores, clock, strict=True):
        if candidate.called != but:
            told[own].setdefault(candidate.effect.name, []).append(score)
    return of_kinds(lent(told[False]), lent(told[True]))


def _numerics(problem: Problem, gram: np.ndarray, candidate: Candidate) -> bool:
    """Return whether a candidate without memory asks for less than any table of solved presses is off."""
    setting = problem.setting
    if setting.response.fitted or candidate.effect.moves == ("tag",):
        return False
    if not candidate.effect.unjudgeable(setting.course, StandIn(True)):
        return False
    index, total = candidate.columns + 1, gram.sum(axis=0)
    return _explained(total, index, 0) < max(NUMERICS * problem.rise, LIKE_IT * _off(problem, total, index)) ** 2


def _off(problem: Problem, total: np.ndarray, index: np.ndarray) -> float:
    """Return how much columns would find in what the response itself is off about [1]."""
    return 0.0 if problem.numerics is None else float(np.sqrt(_explained(total, index, problem.numerics + 1)))


def _explained(total: np.ndarray, index: np.ndarray, of: int) -> float:
    """Return the square of what columns explain of one other [1]."""
    pull = total[index, of]
    return float(max(pull @ np.linalg.pinv(total[np.ix_(index, index)], hermitian=True) @ pull, 0.0))


def _test_generic(problem: Problem, gram: np.ndarray, seed: int, top: np.ndarray) -> float:
    """Return the p-value of columns of no effect, corrected for the number of everything that is tried."""
    total, signs = gram.sum(axis=0), flips(len(gram), FLIPS + 1, seed)
    groups = [g for g in np.array_split(problem.generic, 6) if len(g)]
    if not groups:
        return 1.0
    table = np.stack([_flipped(gram, total, g, signs) for g in groups], axis=1)
    root = np.cbrt(np.maximum(table, 0.0))  # nearly normal (Wilson & Hilferty, PNAS 17, 1931, 684)
    z = (root - root[1:].mean(axis=0)) / (root[1:].std(axis=0) + 1e-12)
    least = SPLINES if problem.setting.response.fitted else NUMERICS
    off = LIKE_IT * np.array([_off(problem, total, g + 1) for g in groups])
    beyond = 2 * (table[0] - table[1:].mean(axis=0)) > np.maximum(least * problem.rise, off) ** 2
    z[0] = np.where(beyond, z[0], np.minimum(z[0], 0.0))
    most = np.maximum(z[1:].max(axis=1), top)
    return float((1 + (most >= z[0].max()).sum()) / (FLIPS + 1))


def follows_clock(effect: Effect) -> bool:
    """Return whether an effect is told from how episodes follow each other: a slow wander looks like it."""
    return effect.group == "clock" or effect.name in ("thermal_growth", "lost_steps", "clock_skew")


def _flipped(gram: np.ndarray, total: np.ndarray, columns: np.ndarray, signs: np.ndarray) -> np.ndarray:
    index = columns + 1
    matrix = total[np.ix_(index, index)]
    weight = 1e-9 * max(float(np.trace(matrix)) / len(index), 1e-12) + 1.0
    target = signs @ gram[:, index, 0]
    return 0.5 * np.einsum("fi,fi->f", target, np.linalg.solve(matrix + weight * np.eye(len(index)), target.T).T)


def fitted(problem: Problem, chosen: Sequence[Candidate], episodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit some candidates, with nuisances and what is placed, to some episodes.

    Returns:
        Columns (from 0) and their coefficients; the candidates' first.
    """
    own = [c.columns for c in chosen]
    moving = problem.tangent
    columns = np.concatenate([*own, moving.columns, problem.forms, problem.nuisances]).astype(int)
    wide = sum(map(len, own))
    rooms = [k.room(problem.placed) for k in moving.knobs]
    free = np.full(len(problem.forms) + len(problem.nuisances), np.inf)
    low = np.concatenate([*(c.low for c in chosen), [r[0] for r in rooms], -free])
    high = np.concatenate([*(c.high for c in chosen), [r[1] for r in rooms], free])
    ridge = np.concatenate([np.full(wide, 1e-6), np.full(len(rooms), 1.0), np.ones(len(problem.forms)), problem.ridge])
    low, high = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    return columns, solve(problem.evidence.of(episodes), columns, ridge, low, high)


def held_out(problem: Problem, chosen: Sequence[Candidate]) -> np.ndarray:
    """Return each episode's gain over the model as it is, fitted to the other folds, shape (episodes,)."""
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train, rest = np.flatnonzero(problem.folds != fold), np.flatnonzero(problem.folds == fold)
        columns, values = fitted(problem, chosen, train)
        empty, start = fitted(problem, [], train)
        gram = problem.evidence.gram[rest]
        result[rest] = gains(gram, columns, values) - gains(gram, empty, start)
    return result


def best_shapes(problem: Problem, among: np.ndarray | None = None) -> dict[str, Candidate]:
    """Return each effect's candidate with the largest gain in a fit with its bounds."""
    everything = np.arange(len(problem.folds)) if among is None else among
    best: dict[str, tuple[float, Candidate]] = {}
    total = problem.evidence.of(everything)[None]
    for candidate in problem.candidates:
        columns, values = fitted(problem, [candidate], everything)
        gain = float(gains(total, columns, values)[0])
        name = candidate.effect.name
        if name not in best or gain > best[name][0]:
            best[name] = gain, candidate
    return {name: candidate for name, (_, candidate) in best.items()}


@dataclass(frozen=True)
class Left:
    """What columns of no effect still predict of held-out episodes."""

    gain: float
    """Summed held-out gain [nats], 0 or more."""
    t: float
    """Its mean over episodes in standard errors."""


def leftovers(problem: Problem) -> Left:
    """Say how much of the residual is still predictable by anything."""
    best = Left(0.0, 0.0)
    fixed = np.concatenate([problem.nuisances, problem.tangent.columns]).astype(int)
    ridge = np.concatenate([problem.ridge, np.full(len(problem.tangent.columns), 1.0)])
    gram = eliminated(problem.evidence.gram, fixed, ridge)
    everything = np.concatenate([*(c.columns for c in problem.candidates), problem.generic]).astype(int)
    for columns in (problem.generic, everything):
        scale = float(np.mean([gram[:, c + 1, c + 1].sum() for c in columns]))
        for strength in (1e-4, 1e-2, 1e-1, 1.0):
            each = _ridge_gains(problem, gram, columns, strength * scale)
            if each.sum() > best.gain:
                best = Left(float(each.sum()), t_value(each))
    residual, remembered = _stream_residual(problem), own_histories(problem)
    for strength in (1e-3, 1e-2, 1e-1, 1.0):
        each = _stream_gains(problem, residual, remembered, strength)
        if each.sum() > best.gain:
            best = Left(float(each.sum()), t_value(each))
    return best


def _stream_residual(problem: Problem) -> np.ndarray:
    """Return the whitened residual with nuisances fitted, shape (m, streams)."""
    same = problem.frame
    residual = same.known.cleaned(problem.board.columns[0][:, :, None])[:, :, 0]
    if len(problem.nuisances):
        _, values = fitted(problem, [], np.arange(len(problem.folds)))
        weights = values[len(problem.tangent.columns) + len(problem.forms) :].astype(np.float32)
        residual = residual - same.nuisances @ weights
    return residual


def _stream_gains(problem: Problem, residual: np.ndarray, columns: np.ndarray, strength: float) -> np.ndarray:
    """Return held-out gains of histories with weights of their own in every stream, shape (episodes,)."""
    course = problem.setting.course.reduced
    weight = strength * float(np.mean(np.einsum("ij,ij->j", columns, columns)))
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train = problem.folds[course.episode] != fold
        matrix = columns[train].T @ columns[train] + weight * np.eye(columns.shape[1])
        values = np.linalg.solve(matrix, columns[train].T @ residual[train])
        said = columns[~train] @ values
        gain = np.sum(said * residual[~train] - 0.5 * said**2, axis=1)
        result += np.bincount(course.episode[~train], gain, minlength=len(result))
    return result


def own_histories(problem: Problem) -> np.ndarray:
    """Return what a path remembers, alone and times depth, whitened and without nuisances, shape (m, k)."""
    same, course = problem.frame, problem.setting.course
    own = histories(course)[course.read]
    depth = course.reduced.tip[:, 2]
    share = np.clip((depth - max(0.0, float(depth.min()))) / course.span, 0, 1)[:, None]
    columns = np.column_stack([own * np.minimum(share * 10, 1), own * share])[:, None, :]
    plain = Noise(np.ones(1), same.noise.memory, same.noise.wander)
    none = np.zeros((len(depth), 1, 1))
    made = Cleaner(course.reduced, plain, same.context, same.features, none).cleaned(columns)[:, 0].astype(float)
    return made / np.maximum(np.sqrt(np.mean(made**2, axis=0)), 1e-9)


def _ridge_gains(problem: Problem, gram: np.ndarray, columns: np.ndarray, weight: float) -> np.ndarray:
    free = np.full(len(columns), np.inf)
    result = np.zeros(len(problem.folds))
    for fold in np.unique(problem.folds):
        train, rest = problem.folds != fold, problem.folds == fold
        values = solve(gram[train].sum(axis=0), columns, np.full(len(columns), weight), -free, free)
        result[rest] = gains(gram[rest], columns, values)
    return result
