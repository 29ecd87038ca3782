"""Depths that presses miss: a stretch that is deeper or shallower, or two groups without a reason.

Each press's error of depth is estimated by generalized least squares. Its spread is a nuisance of the null model. Its
distribution over presses is tested here.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2_contingency

from tacdata.chain import Course
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.randomization import DRAWS, RATE, highest
from tacdata.discrepancy.noise.nuisances import FITTED_DEPTH_PRIOR, POSE_PRIOR
from tacdata.discrepancy.noise.variance_components import one_by_one
from tacdata.discrepancy.search.problem import Problem

FEWEST = 16
"""Presses, at least."""
LEAST_STRETCH = 4
"""Presses of a stretch, and around it, at least."""
MOST_EDGES = 60
"""Stretches begin and end at so many presses, at most."""
LEAST_Z = 5.0
"""A stretch differs by so many standard errors, at least [1]."""
LEAST_RATIO = 13.0
"""Twice the log-likelihood ratio of two groups against one [1]. Noise reaches 10.6 in 1 of 200 draws."""
LEAST_GROUP = 0.2
"""Share of the smaller group, at least [1]."""
REASON = 0.01
"""P-value below which groups depend on place, tool, depth, rate or session, and raise no alarm [1]."""
ROUNDS = 60
"""Steps of the expectation-maximization."""
LEAST_MM = 0.002
"""Smaller differences of depth are no tool's [mm]."""
UNINFORMED = 1e-4


def press_depths(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of depths that presses miss, or none."""
    problem = cleaned.problem
    episodes, depth, error, unit = estimates(problem)
    if len(episodes) < FEWEST:
        return []
    course = problem.setting.course
    place = np.zeros(course.episodes, dtype=np.int64)
    place[course.reduced.episode] = problem.null.context
    segment = stretch(depth, place[episodes])
    if segment is not None and abs(segment[2]) * unit >= LEAST_MM:
        begin, end, by = segment
        first, last = (course.names[int(episodes[k])] for k in (begin, end - 1))
        way = "deeper" if by > 0 else "less deep"
        bound = "at least " if problem.setting.response.fitted else ""  # which takes up a part of it
        back = ", and the depth comes back" if end < len(depth) and begin > 0 else ""
        return [
            Alarm(
                f"from {first} to {last} presses go {bound}{abs(by) * unit:.2g} mm {way} than others of a place{back}: "
                "as if steps were lost and found, or something lay under the sensor",
                "measure the height of a fixed point at every tenth press; look at the guide and at "
                "what holds the sensor",
            )
        ]
    if problem.setting.response.fitted:
        return []  # each place's depth is its own: it hides a difference of two groups
    groups = two_groups(depth, error)
    if groups is None or abs(groups[1]) * unit < LEAST_MM or reasoned(course, episodes, groups[0]):
        return []
    lower, by = groups
    return [
        Alarm(
            f"presses fall in two groups {by * unit:.2g} mm apart in depth, of {int(lower.sum())} and "
            f"{int((~lower).sum())}, and neither place, tool, depth nor rate says which: as if the "
            "tool slid in its holder",
            "tighten the tool and what holds the sensor; make one press thirty times and look at its depths",
        )
    ]


def estimates(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return presses, each one's error of depth and how far that is unsure [estimated spread], and this in mm."""
    null, setting = problem.null, problem.setting
    whitener = null.whitener_for(setting, [*setting.given, *problem.placed])
    each = one_by_one(whitener.joint_scores(np.nan_to_num(problem.board.columns[0]), null.errors))
    each = [run for run in each if np.diagonal(run.information).min() > 0]  # sealed presses say nothing
    presses = np.array([run.episodes[0] for run in each], dtype=np.int64)
    kinds = null.errors.shape[2]
    information = np.array([run.information for run in each]).reshape(-1, kinds, kinds)
    unsure = np.linalg.inv(information + UNINFORMED * np.eye(kinds))
    estimate = np.einsum("ekl,el->ek", unsure, np.array([run.score[0] for run in each]).reshape(-1, kinds))[:, 0]
    error = np.sqrt(np.maximum(unsure[:, 0, 0] - 1.0, 0.0))  # the spread itself is in it
    prior = FITTED_DEPTH_PRIOR * setting.course.stroke if setting.response.fitted else POSE_PRIOR[2]
    size = 1.0 if null.sizes is None else float(null.sizes[0])
    return presses, estimate, error, prior * size


def stretch(depth: np.ndarray, place: np.ndarray, seed: int = 0) -> tuple[int, int, float] | None:
    """Return where a stretch begins and ends that differs from the rest, and by how much; None if there is none.

    Levels of places are taken off. Short stretches are many: they pay for that (a multiscale penalty).
    """
    count = len(depth)
    levels = (place[:, None] == np.unique(place)).astype(float)
    basis, _ = np.linalg.qr(levels)
    at = np.unique(np.linspace(0, count, min(count, MOST_EDGES) + 1).astype(int))
    begin, end = (at[k] for k in np.triu_indices(len(at), 1))
    long = end - begin
    mask = (long >= LEAST_STRETCH) & (long <= count - LEAST_STRETCH)
    begin, end, long = begin[mask], end[mask], long[mask]
    order = np.arange(count)[:, None]
    inside = ((order >= begin) & (order < end)).astype(float)
    inside -= basis @ (basis.T @ inside)
    power = np.square(inside).sum(axis=0)
    # A stretch that coincides with the visits of a place is explained by its level: no contrast remains.
    mask = power > 1.5
    freedom = count - levels.shape[1] - 1
    if not mask.any() or freedom < LEAST_STRETCH:
        return None
    begin, end, long, contrast = begin[mask], end[mask], long[mask], inside[:, mask] / np.sqrt(power[mask])
    remainder = depth - basis @ (basis.T @ depth)
    # Permutations: without a stretch the presses of a place are exchangeable.
    rng = np.random.default_rng([seed, 31])
    drawn = np.stack([remainder, *(rng.permutation(remainder) for _ in range(DRAWS))])
    drawn -= (drawn @ basis) @ basis.T
    by = drawn @ contrast
    residual_power = np.maximum(np.square(drawn).sum(axis=1, keepdims=True) - np.square(by), 1e-12)
    z = np.abs(by) / np.sqrt(residual_power / freedom)
    # Short stretches are many, so the largest of them is large by chance.
    fair = z - np.sqrt(2 * np.log(count / np.minimum(long, count - long)))
    test = highest(fair)
    best = test.at
    if test.p > RATE or z[0, best] < LEAST_Z:
        return None
    return int(begin[best]), int(end[best]), float(by[0, best] / np.sqrt(power[mask][best]))


def two_groups(depth: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return which presses are of the lower of two groups, and how far these are apart; None if one will do.

    Args:
        depth: Of each press, shape (presses,).
        error: How far each is unsure, shape (presses,).
    """
    spread, order = float(np.std(depth)), np.sort(depth)
    if spread <= 0:
        return None
    error_variance = np.square(error)
    floor = (0.1 * spread) ** 2
    fits = []
    # Expectation-maximization ends at the nearest optimum, so it starts from three divisions.
    for cut in (len(depth) // 3, len(depth) // 2, 2 * len(depth) // 3):
        share, low, high, between = 0.5, float(order[:cut].mean()), float(order[cut:].mean()), (0.5 * spread) ** 2
        for _ in range(ROUNDS):
            variance = between + error_variance
            first = np.log(share) - 0.5 * np.square(depth - low) / variance
            second = np.log(1 - share) - 0.5 * np.square(depth - high) / variance
            lower = 1 / (1 + np.exp(np.clip(second - first, -50, 50)))
            share = float(np.clip(lower.mean(), LEAST_GROUP, 1 - LEAST_GROUP))
            low = float(np.average(depth, weights=lower / variance + 1e-12))
            high = float(np.average(depth, weights=(1 - lower) / variance + 1e-12))
            square = lower * np.square(depth - low) + (1 - lower) * np.square(depth - high)
            between = max(float(np.mean(square - error_variance)), floor)
        fits.append((_likelihood(depth, error_variance + between, share, low, high), lower > 0.5, high - low))
    best, lower, separation = max(fits, key=lambda fit: fit[0])
    middle = float(depth.mean())
    for _ in range(5):
        between = max(float(np.mean(np.square(depth - middle) - error_variance)), floor)
        middle = float(np.average(depth, weights=1 / (between + error_variance)))
    single = _likelihood(depth, error_variance + between, 0.5, middle, middle)
    enough = min(lower.sum(), (~lower).sum()) >= LEAST_GROUP * len(depth)
    return (lower, separation) if enough and 2 * (best - single) >= LEAST_RATIO else None


def _likelihood(depth: np.ndarray, variance: np.ndarray, share: float, low: float, high: float) -> float:
    first = np.log(share) - 0.5 * np.square(depth - low) / variance
    second = np.log(1 - share) - 0.5 * np.square(depth - high) / variance
    return float(np.sum(np.logaddexp(first, second) - 0.5 * np.log(variance)))


def reasoned(course: Course, episodes: np.ndarray, lower: np.ndarray) -> bool:
    """Return whether a known property of presses determines their group."""
    rows = [np.flatnonzero(course.episode == e) for e in episodes]
    deep = np.array([round(float(course.tip[r, 2].max()), 2) for r in rows])
    fast = np.array([round(float(np.log(max(np.abs(course.speed[r]).max(), 1e-6))), 0) for r in rows])
    tool = np.array([course.tool[r[0]] for r in rows])
    for feature in (course.site[episodes], tool, deep, fast, course.session[episodes]):
        kinds = np.unique(feature)
        # Kinds of one press each would determine any group.
        if not 1 < len(kinds) <= len(episodes) // 2:
            continue
        # A division that follows place, tool, depth, rate or session has an ordinary cause.
        table = np.array([[np.sum((feature == k) & lower), np.sum((feature == k) & ~lower)] for k in kinds])
        if chi2_contingency(table)[1] < REASON:
            return True
    return False
