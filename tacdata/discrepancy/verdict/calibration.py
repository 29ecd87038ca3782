"""Calibration: gains and scales beyond its tolerance, and the compliance that known specimens determine."""

from __future__ import annotations

import numpy as np

from tacdata.discrepancy.model.series_compliance import series_compliance
from tacdata.discrepancy.search.findings import Findings, FoundEffect
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


def gains_beyond_calibration(findings: Findings) -> list[FoundEffect]:
    """Return gains beyond the tolerance of calibration: one common to all channels, or those of some."""
    setting, gains = findings.problem.setting, findings.gains[np.isfinite(findings.gains)]
    per_channel = setting.channel_gain
    if per_channel is None or not np.any(gains):
        return []
    prior, effects = setting.nuisance[per_channel.name], []
    common = float(np.median(gains))
    if abs(common) > BEYOND * prior / np.sqrt(len(gains)) * 2 and _steady(
        np.nanmedian(findings.halves, axis=1), common
    ):
        # Normal gains: the standard error of a median is sqrt(pi / 2) = 1.25 times that of a mean.
        error = float(1.25 * np.std(gains) / np.sqrt(len(gains)))
        alike = sorted({e.called for e in library() if e.like_gain is not None})
        rivals = tuple(alike) if setting.course.force is None else ()
        effect = next(e for e in library() if e.gain is GainKind.COMMON)
        effects.append(_finding(effect, np.array(common), error, rivals, abs(common) / max(error, 1e-9)))
    deviations = np.nan_to_num(findings.gains - common)
    spread = float(np.sqrt(np.mean(np.square(gains - common))))
    # If all gains scatter more than the prior, the prior is the measure: the sensor was calibrated worse than assumed.
    # Otherwise a channel must be an outlier among the others.
    usual = prior if spread > WIDE * prior else max(prior, 1.4826 * float(np.median(np.abs(gains - common))))
    far = np.abs(deviations) > (BEYOND if spread > WIDE * prior else OUTLYING) * usual
    # A gain that changes over the session is no calibration error, but swapped channels or a loose contact.
    far &= _steady(findings.halves - np.nanmedian(findings.halves, axis=1, keepdims=True), deviations)
    if far.any():
        effects.append(
            _finding(per_channel, np.where(far, deviations, 0.0), prior, (), float(np.abs(deviations).max() / prior))
        )
    return effects


def compliance_of_specimens(findings: Findings) -> list[FoundEffect]:
    """Return the series compliance common to specimens of different stiffness; empty where they show none.

    Its rivals remain: laws of the specimens could differ in the order of their stiffness by chance.
    """
    series = series_compliance(findings.problem.setting.course) if findings.problem.setting.response.fitted else None
    if series is None:
        return []
    effect = next(e for e in library() if e.in_series)
    rivals = tuple(e.called for e in library() if e.group == effect.group and e.stage == "mechanics")
    value, error = series.compliance * series.largest, series.error * series.largest
    return [_finding(effect, np.array(value), error, rivals, series.compliance / series.error)]


def _steady(halves: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Return whether a gain is the same in both halves of the session; True where one half does not determine it."""
    difference = np.abs(np.nan_to_num(halves[1] - halves[0]))
    return difference < STEADY * np.abs(gain)


def _finding(effect: Effect, value: np.ndarray, error: float, rivals: tuple[str, ...], necessity: float) -> FoundEffect:
    """Return an effect of a size as a finding, without the statistics of the search."""
    name = effect.amplitudes[0].name
    return FoundEffect(Placed(effect, {name: value}), {name: error}, (), rivals, {}, necessity, needed=BEYOND)


def calibration_error(finding: FoundEffect) -> bool:
    """Return whether a drive and its observer disagree by no more than the tolerance of the observer's calibration.

    The effect or one of its rivals must be the scale of the observer.
    """
    placed = finding.placed
    if placed.effect.scale is None:
        return False
    observers = {e.called for e in library() if e.scale is Scale.OBSERVER}
    if not observers & {placed.effect.called, *finding.rivals}:
        return False
    return all(abs(float(value)) <= BEYOND * OBSERVER_SCALE for value in placed.values.values())
