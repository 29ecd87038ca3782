"""Gains of the channels, from responses relative to those to the same presses at another visit, or to predicted ones.

    response = gain * (reference at a tip displaced by dx, dy, dz) + error

over presses, channels and levels, by generalized least squares, made linear about the shift (dx, dy, dz) in rounds.
The shift of the whole visit is the error of a registration. It has the sensor file's spread as its prior. Errors are
noise of readings, of time, of the shift's own effect, and two relative ones (`mixed_model`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from tacdata.health.estimate import UncertainValue
from tacdata.health.fall_off import FallOff, fall_off
from tacdata.health.mixed_model import START, SiteRows, relative_errors, solve
from tacdata.health.response import PressResponse
from tacdata.sensor import Sensor

FEWEST = 3
"""Sites that a comparison needs [count]."""
NEAR, CLEAR = 0.05, 10.0
"""Response from which a channel counts as pressed: share of the press's strongest [1], and times the noise [1]."""
FAINT = 0.05
"""Part of the press's strongest response that relative errors are taken of, besides the channel's own response [1]."""
TIMING = 0.005
"""Error of the time between motion and readings in one recording [s]; it shifts the depth of the way in."""
LEVEL = 0.003
"""Relative error of each level by itself [1]: the residual of straight lines and polynomials."""
ROUNDS = 3
"""Rounds in which shift and gains are linearized again [count]."""
MISFIT = 0.15
"""Relative error of the fall-off's prediction of a shift [1]."""
STEEPER = 0.05
"""Relative error of the slope's prediction of a shift of depth [1]."""
REMAINS, DEEPER = 0.005, 0.3
"""Error of the common gain that stays [1], and that by a shift of depth [1/mm]: gain and depth are partly collinear."""
WEAKEST = 0.05
"""Smallest gain about which is made linear [1]."""
AXES = ("depth", "x", "y")


@dataclass(frozen=True)
class GainFit:
    """Gains of a visit relative to a reference."""

    channels: dict[int, UncertainValue]
    """Gain of each channel that was pressed [1]."""
    common: UncertainValue
    """Their median, common to all channels [1]."""
    own: dict[int, UncertainValue] = field(default_factory=dict)
    """Gain of each channel over the common one [1]."""
    shift: dict[str, UncertainValue] = field(default_factory=dict)
    """By how much the tip stood elsewhere than at the reference: depth, x and y [mm]."""
    presses: int = 0
    """Sites compared [count]."""


@dataclass(frozen=True)
class _Pair:
    """Mean responses at one site, before and now."""

    before: PressResponse
    after: PressResponse
    channels: list[int]
    """Channels that are fitted there."""


def fit_gains(
    reference: Sequence[PressResponse],
    measured: Sequence[PressResponse],
    noise: np.ndarray,
    sensor: Sensor,
    left_out: frozenset[int] = frozenset(),
    predicted: bool = False,
) -> GainFit | None:
    """Return the gains; None with fewer than `FEWEST` sites or where no channel responds.

    Args:
        reference: Responses that the presses had then, or are predicted to have.
        measured: Responses to the same presses, in the same order.
        noise: Noise of each channel [counts], shape (taxels,).
        sensor: The sensor: places of its taxels, spreads of its registration.
        left_out: Channels that are not fitted: dead or undefined ones.
        predicted: Whether the reference comes from a model, which has no noise and may count in other units.
    """
    sites: dict[Any, list[int]] = {}
    for k, press in enumerate(reference):
        sites.setdefault(press.key[:4], []).append(k)
    reference_sites = [_averaged([reference[k] for k in rows]) for rows in sites.values()]
    measured_sites = [_averaged([measured[k] for k in rows]) for rows in sites.values()]
    near = [[k for k in pressed(press, noise) if k not in left_out] for press in reference_sites]
    pairs = [_Pair(*pair) for pair in zip(reference_sites, measured_sites, near, strict=True) if pair[2]]
    channels = sorted({k for pair in pairs for k in pair.channels})
    if len(pairs) < FEWEST:
        return None
    fall = fall_off([p.before for p in pairs], [p.channels for p in pairs], sensor.taxels.centers)
    freedom = max(float(sum(len(p.channels) for p in pairs) - len(channels)), 1.0)
    visits = 1.0 if predicted else 2.0
    # Gains have no prior; depth, x and y have the spread of a new registration at each visit.
    precision = np.concatenate([np.zeros(len(channels)), 1 / (visits * np.square(_spreads(sensor)))])
    value = np.concatenate([np.full(len(channels), _scale(pairs) if predicted else 1.0), np.zeros(3)])
    covariance, errors = np.empty((0, 0)), np.array(START)
    # The rows are linear about the shift, so they are solved again about the one found.
    for number in range(ROUNDS):
        rows = [_rows(pair, channels, value, fall, noise, visits, sensor) for pair in pairs]
        if number:  # the first round only finds the shift
            errors = relative_errors(rows, precision)
        value, covariance = solve(rows, precision, errors)
    return _fit(value, covariance, channels, len(pairs), freedom)


def _averaged(presses: list[PressResponse]) -> PressResponse:
    """Return the mean responses to presses at one site."""
    levels, slope, spread = (np.mean([getattr(p, n) for p in presses], axis=0) for n in ("levels", "slope", "spread"))
    return replace(presses[0], levels=levels, slope=slope, spread=spread / len(presses))


def pressed(press: PressResponse, noise: np.ndarray) -> list[int]:
    """Return the channels that a press excites."""
    hold = np.abs(press.hold)
    return np.flatnonzero(hold > np.maximum(CLEAR * noise, NEAR * hold.max())).tolist()


def _scale(pairs: list[_Pair]) -> float:
    """Return about how much stronger all responses are than the reference [1]."""
    ratios = [pair.after.hold[k] / pair.before.hold[k] for pair in pairs for k in pair.channels]
    return max(float(np.median(ratios)), 1e-6)


def _spreads(sensor: Sensor) -> list[float]:
    """Return the spreads of a registration in depth, x and y [mm]."""
    stated: dict[str, Any] = sensor.uncertainty or {}
    return [stated.get(name) or usual for name, usual in (("z", 0.02), ("x", 0.05), ("y", 0.05))]


def _rows(
    pair: _Pair, channels: list[int], value: np.ndarray, fall: FallOff, noise: np.ndarray, visits: float, sensor: Sensor
) -> SiteRows:
    """Return the observations of a site, linear about gains and shift as they are known."""
    members, count, levels = pair.channels, len(pair.channels), len(pair.before.spread)
    place, shift = [channels.index(k) for k in members], value[-2:]
    # Responses of a gain near 0 would have no relative error, and so all the weight.
    gain = np.maximum(value[place], WEAKEST * float(np.median(value[: len(channels)])))[:, None]
    away = sensor.taxels.centers - (pair.before.press.x, pair.before.press.y)
    factor, sides = (np.moveaxis(part[:, members], 0, 1) for part in fall.shifted(away, shift))
    predicted = factor * pair.before.levels[:, members].T  # (channels, levels)
    # The mean of both slopes is right to second order in the shift of depth.
    slope = 0.5 * (gain * factor * pair.before.slope[:, members].T + pair.after.slope[:, members].T)
    design = np.zeros((count, levels, len(value)))
    design[np.arange(count), :, place] = predicted
    design[:, :, -3] = slope
    design[:, :, -2:] = (gain * predicted)[:, :, None] * sides
    response = pair.after.levels[:, members].T + design[:, :, -2:] @ shift
    felt, faint = gain * predicted, FAINT * gain * np.abs(pair.before.hold).max() * np.ones_like(predicted)
    timing = TIMING * pair.before.press.speed * slope
    timing[:, -1] = 0.0  # a hold does not depend on when it began
    reading = visits * (np.diag(pair.after.spread) + pair.after.spread[-1])  # the reading at rest is shared
    covariance = np.kron(np.diag(np.maximum(noise[members], 1.0) ** 2), reading) + visits * np.outer(timing, timing)
    covariance += np.diag((LEVEL * (np.abs(felt) + faint) + STEEPER * np.abs(slope * value[-3])).ravel() ** 2)
    covariance += _each(MISFIT * design[:, :, -2:] @ shift)
    # A relative error is like another gain, at all levels; else the levels of one press would tell gains.
    loading = _each(felt) + _each(faint)
    return SiteRows(design.reshape(count * levels, -1), response.ravel(), covariance, loading, np.outer(felt, felt))


def _each(size: np.ndarray) -> np.ndarray:
    """Return the covariance of an error that each channel has by itself, the same at all its levels, shape (n, n).

    Args:
        size: Effect of the error on the response [counts], shape (channels, levels).
    """
    return np.asarray(block_diag(*(np.outer(errors, errors) for errors in size)))


def _fit(value: np.ndarray, covariance: np.ndarray, channels: list[int], sites: int, freedom: float) -> GainFit:
    count = len(channels)
    gain, error = value[:count], np.sqrt(np.maximum(np.diag(covariance), 0.0))
    middle = float(np.median(gain))
    # The errors of gains are correlated: they share the shift and the sites.
    mean, centring = np.full(count, 1 / count), np.eye(count) - 1 / count
    remains = middle * np.hypot(REMAINS, DEEPER * value[count])
    shared = float(np.hypot(np.sqrt(max(mean @ covariance[:count, :count] @ mean, 0.0)), remains))
    errors = np.sqrt(np.maximum(np.diag(centring @ covariance[:count, :count] @ centring.T), 0.0))
    pairs = list(enumerate(channels))
    return GainFit(
        {k: UncertainValue(float(gain[i]), float(error[i]), freedom) for i, k in pairs},
        UncertainValue(middle, shared, freedom),
        {k: UncertainValue(float(gain[i] / middle), float(errors[i] / middle), freedom) for i, k in pairs},
        {name: UncertainValue(float(value[i]), float(error[i]), freedom) for i, name in enumerate(AXES, count)},
        sites,
    )
