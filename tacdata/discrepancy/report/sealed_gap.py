"""Sealed episodes: excluded from the search, to measure the gap before and after the effects without bias."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tacdata.chain import Course, predict
from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.regressors.generic import histories
from tacdata.discrepancy.report.likelihood_ratio import LikelihoodRatio, likelihood_ratio
from tacdata.discrepancy.search.problem import Problem
from tacdata.effects import Placed

SEALED_SHARE = 0.1
"""Share of the episodes that is sealed [1]..."""
LEAST_SEALED = 4
"""...but at least this number. A few are enough to measure the gap; the search needs all the others [episodes]."""
FEWEST_TO_SEAL = 20
"""With fewer episodes none is sealed: all are needed for the verdict."""
OPEN_EACH = 2
"""Episodes of a place and indenter that stay open, at least."""
DEEPER = 0.02
"""A sealed episode goes deeper than all open ones of its place by at most this share [1]."""
FLOOR = 1.0
"""Mean square of noise alone [1]."""
LEAST_GAP = 1e-2
"""Smallest gap above the floor of which a closed share is stated [1]."""
WIDEST = 0.5
"""A share is stated where its 90 % interval is narrower [1]."""
BOOTSTRAPS = 2000
"""Bootstrap: resamplings of the sealed episodes."""
RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
"""Ceiling: ridges to choose from, over the mean diagonal [1]."""


def chosen(course: Course) -> np.ndarray:
    """Return the sealed episodes, in the order of a hash of session and name, shape (k,), int64.

    An episode deeper than all that stay open at its place is left open: a response fitted to the others is
    not known at such depths.
    """
    if course.episodes < FEWEST_TO_SEAL:
        return np.zeros(0, dtype=np.int64)
    # Names decide, not readings: the choice cannot depend on the result, and a repeated judgement seals the same
    # presses.
    keys = [f"{course.session[k]}/{course.names[k]}" for k in range(course.episodes)]
    order = sorted(range(course.episodes), key=lambda k: hashlib.sha256(keys[k].encode()).digest())
    tool = np.array([course.tool[course.episode == k][0] for k in range(course.episodes)])
    depth = np.array([course.tip[course.episode == k, 2].max() for k in range(course.episodes)])
    candidates: dict[tuple[int, int], list[int]] = {}
    for k in range(course.episodes):
        candidates.setdefault((int(course.site[k]), int(tool[k])), []).append(k)
    episodes: list[int] = []
    for k in order:
        siblings = [sibling for sibling in candidates[int(course.site[k]), int(tool[k])] if sibling != k]
        enough = len(siblings) >= OPEN_EACH and depth[siblings].max() >= (1 - DEEPER) * depth[k]
        if len(episodes) < max(int(SEALED_SHARE * course.episodes), LEAST_SEALED) and enough:
            episodes.append(k)
            candidates[int(course.site[k]), int(tool[k])] = siblings
    return np.sort(np.array(episodes, dtype=np.int64))


def without_readings(course: Course, episodes: np.ndarray) -> Course:
    """Return the course without the readings of some episodes; their path stays, since it changes the skin's state."""
    return replace(course, averaged=np.where(course.of(episodes), 0.0, course.averaged))


@dataclass(frozen=True)
class Gap:
    """Mean squares of the residual of sealed episodes, over the noise [1]; the offset of each episode is removed."""

    before: np.ndarray
    """Of each sealed episode [1], shape (k,)."""
    after: np.ndarray
    """The same with the effects in place [1], shape (k,)."""
    ceiling: np.ndarray
    """The same after a regression of the residual on histories of the path, of no particular effect [1], shape (k,)."""
    names: tuple[str, ...]
    without: dict[str, np.ndarray] = field(default_factory=dict)
    """Effect -> the same with all effects but that one [1], shape (k,)."""
    ratio: LikelihoodRatio | None = None
    """Likelihood ratio of the sealed episodes, with the effects over without; None where there are none."""

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval of the closed share [1], by bootstrap over sealed episodes; -inf to inf if there are none."""
        if not len(self.before):
            return -np.inf, np.inf
        low, high = _between(_closed(*self._drawn()))
        return low, high

    def _drawn(self) -> tuple[np.ndarray, np.ndarray]:
        """Return bootstrap draws of both means [1], shape (draws,) each."""
        # A fixed seed: the same recordings must give the same interval.
        pick = np.random.default_rng(0).integers(len(self.before), size=(BOOTSTRAPS, len(self.before)))
        return self.before[pick].mean(axis=1), self.after[pick].mean(axis=1)

    def document(self) -> dict[str, Any]:
        """Return it as in the verdict."""
        if not len(self.before):
            return {"episodes": 0, "share": SEALED_SHARE, "rule": f"none of fewer than {FEWEST_TO_SEAL} episodes"}
        best = min(float(self.ceiling.mean()), float(self.after.mean()))
        worst = int(np.argmax(self.after))
        base, final = self._drawn()
        closed, (low, high) = _closed(self.before.mean(), self.after.mean()), self.interval
        return {
            "episodes": len(self.before),
            "share": SEALED_SHARE,
            "rule": f"least SHA-256 of session/name, {LEAST_SEALED} at least",
            "before": float(self.before.mean()),
            "after": float(self.after.mean()),
            "floor": FLOOR,
            "ceiling": best,
            "before_interval": _between(base),
            "after_interval": _between(final),
            "closed": float(closed),
            "interval": [low, high],
            "certain": high - low < WIDEST,
            "shares": self._shares(float(closed)),
            "worst": {"episode": self.names[worst], "after": float(self.after[worst])},
            **({} if self.ratio is None else {"ratio": self.ratio.document()}),
        }

    def _shares(self, closed: float) -> dict[str, float]:
        """Return each effect's part of the closed share, in proportion to the rise of the mean square without it."""
        cost = {name: max(float((errors - self.after).mean()), 0.0) for name, errors in self.without.items()}
        total = sum(cost.values())
        return {name: closed * by / total if total > 0 else 0.0 for name, by in cost.items()}


def _between(draws: np.ndarray) -> list[float]:
    """Return a 90 % interval."""
    return [float(v) for v in np.quantile(draws, [0.05, 0.95])]


def _closed(base: np.ndarray, final: np.ndarray) -> np.ndarray:
    """Return the share of the gap above the noise floor that is closed [1]; 0 where there is none."""
    room = np.asarray(base) - FLOOR
    return np.where(room > LEAST_GAP, (np.asarray(base) - final) / np.maximum(room, LEAST_GAP), 0.0)


def gap(
    course: Course,
    before: Problem,
    after: Problem,
    episodes: np.ndarray,
    beyond: Sequence[Placed] = (),
    without: Mapping[str, Optimum] | None = None,
) -> Gap:
    """Return the gap on sealed episodes.

    Args:
        course: All recordings, the sealed ones with their readings.
        before: The model as it was given, without the sealed episodes.
        after: The model with its effects, without the sealed episodes.
        episodes: The sealed ones.
        beyond: Gains beyond calibration.
        without: Effect -> the model with all effects but that one.
    """
    if not len(episodes):
        return Gap(np.zeros(0), np.zeros(0), np.zeros(0), ())
    given, response = list(before.setting.given), before.setting.response
    rows = course.read
    measured = Streams.of(course).measured(course)[:, : course.channels]
    first = measured - predict(course, response, given).signal[rows]
    last = measured - predict(course, after.setting.response, [*given, *after.placed, *beyond]).signal[rows]
    remainder = first - _predicted(course, np.nan_to_num(first), episodes)
    noise = after.null.noise
    # ``scale`` is that of the innovations of an AR(1) process. Readings scatter by more, by 1 / sqrt(1 - memory^2).
    scale = noise.scale[: course.channels] / np.sqrt(max(1 - noise.memory**2, 0.02))
    number = course.episode[rows]
    base, final, ceiling = (_squares(r / scale, number, episodes) for r in (first, last, remainder))
    others = {}
    for name, model in (without or {}).items():
        residual = measured - predict(course, model.response, [*given, *model.placed]).signal[rows]
        others[name] = _squares(residual / scale, number, episodes)
    names = tuple(course.names[k] for k in episodes)
    return Gap(base, final, ceiling, names, others, likelihood_ratio(course, before, after, beyond))


def _squares(residual: np.ndarray, number: np.ndarray, episodes: np.ndarray) -> np.ndarray:
    squares = []
    for k in episodes:
        values = residual[number == k]
        squares.append(float(np.nanmean(np.square(values - np.nanmedian(values, axis=0)))))
    return np.array(squares)


def _predicted(course: Course, residual: np.ndarray, episodes: np.ndarray) -> np.ndarray:
    """Return the prediction of a residual by a ridge regression on histories of the path, fitted to open episodes."""
    history = histories(course)[course.read]
    share = np.clip(course.tip[course.read, 2] / course.span, 0.0, None)[:, None]
    columns = np.column_stack([history * np.minimum(share * 10, 1), history * share, history])
    columns = columns / np.maximum(columns.std(axis=0), 1e-9)
    number = course.episode[course.read]
    sealed = np.isin(number, episodes)
    # The ridge is chosen on whole presses: readings of one press are correlated, so a split by reading would overfit.
    validation = ~sealed & (number % 4 == 0)
    best, chosen_weight = np.inf, RIDGES[-1]
    for strength in RIDGES:
        train = ~sealed & ~validation
        error = residual[validation] - columns[validation] @ _ridge(columns[train], residual[train], strength)
        if float(np.mean(np.square(error))) < best:
            best, chosen_weight = float(np.mean(np.square(error))), strength
    return columns @ _ridge(columns[~sealed], residual[~sealed], chosen_weight)


def _ridge(columns: np.ndarray, target: np.ndarray, strength: float) -> np.ndarray:
    gram = columns.T @ columns
    weight = strength * float(np.mean(np.diag(gram)))
    return np.linalg.solve(gram + weight * np.eye(len(gram)), columns.T @ target)


def refuted(sealed: Gap | None) -> bool:
    """Return whether sealed episodes refute an answer (`LikelihoodRatio.refutes`)."""
    return sealed is not None and sealed.ratio is not None and sealed.ratio.refutes


def borne_out(sealed: Gap | None) -> bool:
    """Return whether sealed episodes alone support an answer (`LikelihoodRatio.bears_out`)."""
    return sealed is not None and sealed.ratio is not None and sealed.ratio.bears_out
