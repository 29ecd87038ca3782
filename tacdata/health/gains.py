"""Gains of the channels, from answers beside those to the same presses at another visit, or beside predicted ones.

Generalized least squares of

    answer - reference = (gain - 1) reference + slope dz + lateral slopes (dx, dy) + error

over presses, channels and levels. The shift (dx, dy, dz) of the whole visit is what a registration errs by; it has the
sensor file's spread as its prior. Errors are noise of readings, a relative error of each channel at each site, and one
of each press. The two relative ones are estimated by restricted maximum likelihood (REML).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.optimize import minimize

from tacdata.health.estimate import UncertainValue
from tacdata.health.response import LEVELS, PressResponse
from tacdata.sensor import Sensor

FEWEST = 3
"""Presses that a comparison needs [count]."""
NEAR, CLEAR = 0.05, 10.0
"""Answer from which a channel counts as pressed: share of the press's strongest [1], and times the noise [1]."""
FAINT = 0.05
"""Part of the press's strongest answer that relative errors are taken of, beside the channel's own answer [1]."""
START = (0.01, 0.003)
"""Relative errors that the search begins with: of a channel in a press, and of a press [1]."""
TIMING = 0.005
"""Error of the time between motion and readings in one recording [s]; it shifts the depth of the way in."""
LEVEL = 0.003
"""Relative error of each level by itself [1]: what straight lines and polynomials leave."""
FALL = 3
"""Degree, in the squared distance, of the fall-off of answers with the distance from the tip."""
REMAINS = 0.005
"""Error of the common gain by shifts that are not small [1]."""
SMALLEST = 1e-4
"""Smallest relative error [1]: presses of a perfect rig would leave none."""


@dataclass(frozen=True)
class GainFit:
    """Gains of a visit beside a reference."""

    channels: dict[int, UncertainValue]
    """Gain of each channel that was pressed [1]."""
    common: UncertainValue
    """Their median: what all channels share [1]."""
    own: dict[int, UncertainValue] = field(default_factory=dict)
    """Gain of each channel over the common one [1]."""
    shift: dict[str, UncertainValue] = field(default_factory=dict)
    """By how much the tip stood elsewhere than at the reference: x, y and depth [mm]."""
    presses: int = 0
    """Presses compared [count]."""


@dataclass(frozen=True)
class _Rows:
    """The observations at one site: levels of each pressed channel, one channel after the other."""

    design: np.ndarray
    """Shape (n, parameters)."""
    off: np.ndarray
    """Answer less reference [counts], shape (n,)."""
    noise: np.ndarray
    """Covariance of what noise and time do [counts^2], shape (n, n)."""
    own: np.ndarray
    """Covariance of a relative error of each channel, for one of 1 [counts^2], shape (n, n)."""
    shared: np.ndarray
    """Covariance of a relative error of the press, for one of 1 [counts^2], shape (n, n)."""


def fit_gains(
    reference: Sequence[PressResponse], measured: Sequence[PressResponse], noise: np.ndarray, sensor: Sensor,
    left_out: frozenset[int] = frozenset(), predicted: bool = False,
) -> GainFit | None:
    """Return the gains; None with fewer than `FEWEST` presses or where no channel answers.

    Args:
        reference: Answers that the presses had then, or are predicted to have.
        measured: Answers to the same presses, in the same order.
        noise: Noise of each channel [counts], shape (taxels,).
        sensor: The sensor: places of its taxels, spreads of its registration.
        left_out: Channels that are not fitted: dead or undefined ones.
        predicted: Whether the reference comes from a model, which has no noise.
    """
    sites: dict[Any, list[int]] = {}
    for k, press in enumerate(reference):
        sites.setdefault(press.key[:4], []).append(k)
    before = [_averaged([reference[k] for k in rows]) for rows in sites.values()]
    after = [_averaged([measured[k] for k in rows]) for rows in sites.values()]
    near = [pressed(press, noise) for press in before]
    channels = [k for k in range(len(noise)) if k not in left_out and any(k in found for found in near)]
    if len(before) < FEWEST or not channels:
        return None
    scale = _scale(before, after, near, channels)
    doubled = 1.0 if predicted else 2.0
    rows = [
        _rows(one, other, [k for k in found if k in channels], channels, scale, noise, doubled, sides)
        for one, other, found, sides in zip(before, after, near, _lateral(before, near, sensor), strict=True)
        if set(found) & set(channels)
    ]
    blocks = sum(len(found) for found in near)
    prior = _prior(sensor, doubled, len(channels))
    value, covariance = _solve(rows, prior, _errors(rows, prior))
    return _fit(value, covariance, channels, scale, len(rows), max(float(blocks - len(channels)), 1.0))


def _averaged(presses: list[PressResponse]) -> PressResponse:
    """Return the mean answers to presses at one site."""
    levels, slope, spread = (np.mean([getattr(p, n) for p in presses], axis=0) for n in ("levels", "slope", "spread"))
    return replace(presses[0], levels=levels, slope=slope, spread=spread / len(presses))


def pressed(press: PressResponse, noise: np.ndarray) -> list[int]:
    """Return the channels that a press excites."""
    hold = np.abs(press.hold)
    return np.flatnonzero(hold > np.maximum(CLEAR * noise, NEAR * hold.max())).tolist()


def _scale(
    reference: Sequence[PressResponse], measured: Sequence[PressResponse], near: list[list[int]], channels: list[int]
) -> float:
    """Return about how much stronger all answers are than the reference [1]; a model may count in other units."""
    ratios = [
        after.hold[k] / before.hold[k]
        for before, after, found in zip(reference, measured, near, strict=True)
        for k in found if k in channels
    ]  # fmt: skip
    return max(float(np.median(ratios)), 1e-3)


def _lateral(reference: Sequence[PressResponse], near: list[list[int]], sensor: Sensor) -> list[np.ndarray]:
    """Return how answers change as the tip moves along x and y, over the answer [1/mm], shape (levels, taxels, 2).

    The logarithm of an answer falls off with the squared distance as a polynomial that all presses share.
    """
    away = [sensor.taxels.centers - (p.press.x, p.press.y) for p in reference]
    squared = [(apart**2).sum(axis=1) for apart in away]
    unit = max(float(np.mean(np.concatenate([s[found] for s, found in zip(squared, near, strict=True)]))), 1e-9)
    powers, falls = np.arange(1, FALL + 1), []
    for level in range(len(LEVELS) + 1):
        terms, heights = [np.zeros((1, FALL))], [np.zeros(1)]
        for press, found, apart in zip(reference, near, squared, strict=True):
            use = [k for k in found if press.levels[level, k] * press.hold[k] > 0]
            if use:
                term, height = (apart[use, None] / unit) ** powers, np.log(np.abs(press.levels[level, use]))
                terms.append(term - term.mean(axis=0))
                heights.append(height - height.mean())
        fall = np.linalg.lstsq(np.vstack(terms), np.concatenate(heights), rcond=None)[0]
        falls.append(powers * fall)
    return [
        np.stack([-2 / unit * ((s[:, None] / unit) ** (powers - 1) @ fall)[:, None] * apart for fall in falls])
        for s, apart in zip(squared, away, strict=True)
    ]


def _rows(
    before: PressResponse, after: PressResponse, found: list[int], channels: list[int], scale: float,
    noise: np.ndarray, doubled: float, sides: np.ndarray,
) -> _Rows:  # fmt: skip
    levels, count = len(before.spread), len(found)
    said = scale * before.levels[:, found].T  # (channels, levels)
    # The mean of both slopes is right to second order in the shift; a channel's own gain is taken out of the second.
    own_gain = scale * before.hold[found] / np.where(after.hold[found] > 0, after.hold[found], np.inf)
    slope = 0.5 * (scale * before.slope[:, found] + np.clip(own_gain, 0.2, 5.0) * after.slope[:, found])
    design = np.zeros((count, levels, len(channels) + 3))
    for row, channel in enumerate(found):
        design[row, :, channels.index(channel)] = said[row]
        design[row, :, -3] = slope[:, row]
        design[row, :, -2:] = said[row, :, None] * sides[:, channel]
    size = np.abs(said) + FAINT * scale * np.abs(before.hold).max()
    sd = np.maximum(noise[found], 1.0)
    one = doubled * np.diag(after.spread) + doubled * after.spread[-1]  # the reading at rest is shared
    flat = said.ravel()
    early = scale * TIMING * before.press.speed * before.slope[:, found].T
    early[:, -1] = 0.0  # a hold does not depend on when it began
    noisy = np.kron(np.diag(sd**2), one) + doubled * np.outer(early, early) + np.diag((LEVEL * size.ravel()) ** 2)
    return _Rows(
        design.reshape(count * levels, -1), (after.levels[:, found].T - said).ravel(), noisy,
        np.asarray(block_diag(*(np.outer(s, s) for s in size))), np.outer(flat, flat),
    )  # fmt: skip


def _prior(sensor: Sensor, doubled: float, channels: int) -> np.ndarray:
    """Return the precision of each parameter before any press, shape (parameters,): gains are free."""
    known: dict[str, Any] = sensor.uncertainty or {}
    spreads = [known.get(name) or usual for name, usual in (("z", 0.02), ("x", 0.05), ("y", 0.05))]
    return np.concatenate([np.zeros(channels), 1 / (doubled * np.square(spreads))])


def _solve(rows: list[_Rows], prior: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    information, score, _ = _sums(rows, prior, errors)
    covariance = np.linalg.pinv(information, hermitian=True)
    return covariance @ score, covariance


def _sums(rows: list[_Rows], prior: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return information, score, and twice the negative restricted log-likelihood but for the fit."""
    information, score, loss = np.diag(prior), np.zeros(len(prior)), 0.0
    for row in rows:
        factor = cho_factor(row.noise + errors[0] ** 2 * row.own + errors[1] ** 2 * row.shared, lower=True)
        whitened = cho_solve(factor, np.column_stack([row.design, row.off]))
        information = information + row.design.T @ whitened[:, :-1]
        score = score + row.design.T @ whitened[:, -1]
        loss += 2 * float(np.log(np.diag(factor[0])).sum()) + float(row.off @ whitened[:, -1])
    return information, score, loss


def _errors(rows: list[_Rows], prior: np.ndarray) -> np.ndarray:
    """Return the two relative errors [1], shape (2,), by REML."""

    def loss(logs: np.ndarray) -> float:
        information, score, rest = _sums(rows, prior, np.maximum(np.exp(logs), SMALLEST))
        return rest - float(score @ np.linalg.pinv(information, hermitian=True) @ score) + float(
            np.linalg.slogdet(information + 1e-12 * np.eye(len(score)))[1]
        )

    found = minimize(loss, np.log(START), method="Nelder-Mead", options={"xatol": 0.05, "fatol": 0.05, "maxfev": 80})
    return np.maximum(np.exp(found.x), SMALLEST)


def _fit(
    value: np.ndarray, covariance: np.ndarray, channels: list[int], scale: float, presses: int, freedom: float
) -> GainFit:
    count = len(channels)
    gain, error = value[:count], np.sqrt(np.diag(covariance))
    middle = float(np.median(gain))
    # The errors of gains are correlated: they share the shift and the presses.
    weights = np.full(count, 1 / count)
    shared = float(np.sqrt(weights @ covariance[:count, :count] @ weights + REMAINS**2))
    common = UncertainValue(scale * (1 + middle), scale * shared, max(presses - 1.0, 1.0))
    apart = np.eye(count) - 1 / count
    spread = np.sqrt(np.maximum(np.diag(apart @ covariance[:count, :count] @ apart.T), 1e-12))
    own = {
        k: UncertainValue((1 + g) / (1 + middle), s / (1 + middle), freedom)
        for k, g, s in zip(channels, gain, spread, strict=True)
    }
    each = {
        k: UncertainValue(scale * (1 + g), scale * e, freedom) for k, g, e in zip(channels, gain, error, strict=False)
    }
    shift = {
        name: UncertainValue(float(value[count + k]), float(error[count + k]), freedom)
        for k, name in enumerate(("depth", "x", "y"))
    }
    return GainFit(each, common, own, shift, presses)
