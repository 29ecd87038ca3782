"""Is an effect's size the same in all conditions? That of a mechanism is; that of a stand-in changes with them.

A remainder has no reason to follow a true effect into every condition. A wrong effect fits the data on the
average of them. So its size from slow presses differs from that of fast ones (invariance: Peters,
Buhlmann & Meinshausen, J. R. Stat. Soc. B 78, 2016, 947).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain import Chain, Course
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.noise.gram import episode_grams
from tacdata.discrepancy.search.findings import Findings
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated

TIME = "time"
CELLS = 3
"""A condition is cut into so many parts of about as many episodes."""
WIDE = 1.25
"""A condition is one where its largest part's value is so many times its smallest's [1]."""
STANDS = 0.02
"""A slower tip is at rest [fastest]."""
UNSURE = 0.25
"""A part whose size is not known within so much carries no information on it [share of the size]."""


def constancies(findings: Findings) -> tuple[dict[str, float], ...]:
    """Return each effect's spread of size over the parts of each condition [share of its size], in their order.

    0: the same in all parts. The scatter of episodes is taken off. Conditions that do not vary are not there.
    """
    final = findings.final
    if not final.placed:
        return ()
    conditions = _conditions(final.setting.course)
    return tuple(_of(final, at, conditions) for at in range(len(final.placed)))


def spread(gram: np.ndarray, parts: int) -> float:
    """Return the spread of a column's coefficient over its parts, that of chance taken off [1].

    All parts count equally, however little of the effect is in them: one that fits fast presses alone is found by the
    slow ones, which hold little of it.

    Args:
        gram: Residual first, then each part's column, other columns eliminated, shape (episodes, 1 + parts, 1 + parts).
        parts: How many there are.
    """
    total = gram.sum(axis=0)
    index = np.flatnonzero(np.diag(total)[1:] > 0) + 1
    if len(index) < 2:
        return 0.0
    information = total[np.ix_(index, index)]
    root = np.sqrt(np.diag(information))  # parts of very different size: solved at one scale
    scaled = information / np.outer(root, root) + 1e-9 * np.eye(len(index))
    inverse = np.linalg.inv(scaled) / np.outer(root, root)
    # The refined coefficient is 1 in all parts, so what is left is each part's deviation from it.
    deviation = inverse @ total[index, 0]
    scores = gram[:, index, 0] - np.einsum("eij,j->ei", gram[:, index][:, :, index], deviation)
    # Sandwich variance with episodes as clusters: it does not rely on the noise model.
    chance = np.diag(inverse @ (scores.T @ scores) @ inverse)
    determined = np.sqrt(chance) <= UNSURE
    if np.count_nonzero(determined) < 2:
        return 0.0
    return float(np.sqrt(max(float(np.mean(np.square(deviation[determined]) - chance[determined])), 0.0)))


def _of(final: Problem, at: int, conditions: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the spread of one effect's size over the parts of each condition."""
    setting, streams = final.setting, Streams.of(final.setting.course)
    other_effects = [*setting.given, *(p for k, p in enumerate(final.placed) if k != at)]
    chain = Chain(setting.course, setting.response, other_effects)
    signal = streams.predicted(chain.again([*other_effects, final.placed[at]])) - streams.predicted(chain.prediction)
    residual = streams.measured(setting.course) - streams.predicted(
        Chain(setting.course, setting.response, [*setting.given, *final.placed]).prediction
    )
    moving = final.tangent.values[:, :, [k for k, knob in enumerate(final.tangent.knobs) if knob.at != at]]
    whitener = final.null.whitener_for(setting, [*setting.given, *final.placed])
    clock = final.placed[at].effect.follows_clock  # its own form contains the change with time
    applicable = {name: labels for name, labels in conditions.items() if not (clock and name == TIME)}
    each = {name: [signal * (labels == k) for k in range(int(labels.max()) + 1)] for name, labels in applicable.items()}
    columns = np.stack([residual, *(c for parts in each.values() for c in parts)], axis=2)
    white = whitener.whitened(np.concatenate([columns, moving], axis=2, dtype=np.float32))
    gram = episode_grams(white, setting.course.reduced, final.null.nuisances, final.null.inner).gram
    count = columns.shape[2]
    fixed = np.arange(count - 1, gram.shape[1] - 1)
    gram = eliminated(gram, fixed, np.concatenate([np.zeros(moving.shape[2]), final.null.ridge]))
    result, first = {}, 1
    for name, parts in each.items():
        columns_of_parts = np.concatenate([[0], np.arange(first, first + len(parts))])
        result[name] = spread(gram[:, columns_of_parts][:, :, columns_of_parts], len(parts))
        first += len(parts)
    return result


def _conditions(course: Course) -> dict[str, np.ndarray]:
    """Return conditions that vary: the part of each value that was read, shape (m, 1) or (1, streams), int64."""
    read, touching = course.read, course.tip[:, 2] > 0.02 * course.span
    episode = course.episode[read]
    way = np.abs(course.speed) * course.step
    fast = np.zeros(course.episodes)
    for e in range(course.episodes):
        rows = (course.episode == e) & touching & ~course.first
        distance = float(way[rows].sum())
        # Weighted by the way, so that a hold does not count as a slow press.
        fast[e] = float((way[rows] * np.abs(course.speed[rows])).sum()) / distance if distance > 0 else np.nan
    deep = np.array([course.tip[course.episode == e, 2].max() for e in range(course.episodes)])
    by_episode = {"rate": _parts(fast), "depth": _parts(deep), TIME: np.arange(course.episodes) * 2 // course.episodes}
    _, place = np.unique(course.site, return_inverse=True)
    by_episode["place"] = place * CELLS // max(int(place.max()) + 1, CELLS) if place.max() >= CELLS else place
    varying = {n: labels[episode][:, None] for n, labels in by_episode.items() if labels.max() > 0}
    speed = course.speed[read]
    moving = np.abs(speed) > STANDS * np.abs(course.speed).max()
    varying["phase"] = np.where(moving, np.where(speed > 0, 0, 2), 1)[:, None]
    count = Streams.of(course).count
    if count > 1:
        varying["stream"] = np.arange(count)[None, :]
    return varying


def _parts(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the part of each value, by size: as many of each, equal ones together; all 0 where they hardly differ."""
    values = np.nan_to_num(np.asarray(values, dtype=float), nan=float(np.nanmedian(values)))
    order = np.sort(values)
    edges = [order[len(order) * k // CELLS] for k in range(1, CELLS)]
    labels = np.searchsorted(np.unique(edges), values * (1 + 1e-3), side="right")
    labels = np.unique(labels, return_inverse=True)[1]
    middle = [float(np.median(values[labels == k])) for k in range(int(labels.max()) + 1)]
    return labels if middle[-1] > WIDE * max(middle[0], 1e-12) else np.zeros(len(values), dtype=np.int64)
