"""Calibration: gains and scales beyond its tolerance, and the compliance that known specimens determine."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.series_compliance import series_compliance
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.posterior.estimates import Z90, Estimate
from tacdata.discrepancy.report.conclusion import Certainty, Level, Named
from tacdata.effects import Effect, GainKind, Placed, Scale, library

BEYOND = 3.0
"""Calibration: a gain or a scale is wrong beyond so many standard deviations of its prior [1]."""
OUTLYING = 4.0
"""Calibration: ... or, where the gains scatter little, beyond so many of their robust standard deviations [1]."""
WIDE = 2.0
"""Calibration: scatter of the gains from which on the prior is too narrow [its standard deviations]."""
STEADY = 0.5
"""Calibration: largest difference between the halves of a session at which a gain is a constant [its size]."""
OBSERVER_SCALE = 0.005
"""Calibration: standard deviation of the scale of a camera or a gauge [1]."""


def gains_beyond_calibration(setting: Setting, gains_found: np.ndarray, halves: np.ndarray) -> list[Named]:
    """Return gains beyond the tolerance of calibration: one common to all channels, or those of some.

    Args:
        setting: With the tolerance.
        gains_found: Each channel's gain beyond the response's [1], shape (channels,); NaN where presses show none.
        halves: The same of the halves of a session [1], shape (2, channels).
    """
    gains, per_channel = gains_found[np.isfinite(gains_found)], setting.channel_gain
    if per_channel is None or not np.any(gains):
        return []
    prior, effects = setting.nuisance[per_channel.name], []
    common = float(np.median(gains))
    if abs(common) > BEYOND * prior / np.sqrt(len(gains)) * 2 and _steady(np.nanmedian(halves, axis=1), common):
        # Normal gains: the standard error of a median is sqrt(pi / 2) = 1.25 times that of a mean.
        error = float(1.25 * np.std(gains) / np.sqrt(len(gains)))
        alike = sorted({e.called for e in library() if e.like_gain is not None})
        rivals = tuple(alike) if setting.course.force is None else ()
        effect = next(e for e in library() if e.gain is GainKind.COMMON)
        effects.append(_named(effect, np.array(common), error, rivals))
    deviations = np.nan_to_num(gains_found - common)
    spread = float(np.sqrt(np.mean(np.square(gains - common))))
    # If all gains scatter more than the prior, the prior is the measure: the sensor was calibrated worse than assumed.
    # Otherwise a channel must be an outlier among the others.
    usual = prior if spread > WIDE * prior else max(prior, 1.4826 * float(np.median(np.abs(gains - common))))
    far = np.abs(deviations) > (BEYOND if spread > WIDE * prior else OUTLYING) * usual
    # A gain that changes over the session is no calibration error, but swapped channels or a loose contact.
    far &= _steady(halves - np.nanmedian(halves, axis=1, keepdims=True), deviations)
    if far.any():
        effects.append(_named(per_channel, np.where(far, deviations, 0.0), prior, ()))
    return effects


def compliance_of_specimens(setting: Setting) -> list[Named]:
    """Return the series compliance common to specimens of different stiffness; empty where they show none.

    Its rivals remain: laws of the specimens could differ in the order of their stiffness by chance.
    """
    series = series_compliance(setting.course) if setting.response.fitted else None
    if series is None:
        return []
    effect = next(e for e in library() if e.in_series)
    rivals = tuple(e.called for e in library() if e.group == effect.group and e.stage == "mechanics")
    return [_named(effect, np.array(series.compliance * series.largest), series.error * series.largest, rivals)]


def _steady(halves: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Return whether a gain is the same in both halves of the session; True where one half does not determine it."""
    difference = np.abs(np.nan_to_num(halves[1] - halves[0]))
    return difference < STEADY * np.abs(gain)


def _named(effect: Effect, value: np.ndarray, error: float, rivals: tuple[str, ...]) -> Named:
    """Return an effect of a size that calibration, not the posterior, determines."""
    p = effect.amplitudes[0]
    spread = np.where(value != 0, error, 0.0)
    ends = np.clip(value - Z90 * spread, p.low, p.high), np.clip(value + Z90 * spread, p.low, p.high)
    estimate = Estimate(value, spread, ends, p.unit, False)
    level, certainty = (None, Certainty.AMBIGUOUS) if rivals else (Level.MECHANISM, Certainty.NAMED)
    rivals = tuple(name for name in rivals if name != effect.called)
    return Named(
        Placed(effect, {p.name: value}),
        -1,
        1.0 if not rivals else 1 / (1 + len(rivals)),
        1.0,
        1.0 if not rivals else 1 / (1 + len(rivals)),
        level,
        rivals,
        certainty,
        {p.name: estimate},
        by_calibration=True,
    )


def calibration_error(one: Named) -> bool:
    """Return whether a drive and its observer disagree by no more than the tolerance of the observer's calibration.

    The effect or one of its alternatives must be the scale of the observer.
    """
    placed = one.placed
    if placed.effect.scale is None:
        return False
    observers = {e.called for e in library() if e.scale is Scale.OBSERVER}
    if not observers & {placed.effect.called, *one.alternatives}:
        return False
    return all(abs(float(value)) <= BEYOND * OBSERVER_SCALE for value in placed.values.values())
