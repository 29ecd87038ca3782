"""The procedure: noise, four touches and a plane; crosses over three taxels and a rigid motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tacdata.errors import DeviceError
from tacdata.recording.onset import POWERS, onset, shared_power
from tacdata.registration.contact_search import LIFT_SPEED
from tacdata.registration.cross_scan import Cross, cross_scan
from tacdata.registration.probe import Probe
from tacdata.registration.result import Found
from tacdata.registration.settings import RegistrationSettings
from tacdata.registration.solution import Plane, fit_plane, fit_rigid_motion
from tacdata.registration.touch_off import Touch, touch_off
from tacdata.rig import Registration
from tacdata.sensor import Sensor

IDLE_FRAMES = 40
"""Readings from which the noise is estimated [count]."""
QUIET_RISE = 0.4
"""Height above the first touch from which the other places are searched [mm], tilt not counted."""


def reference_taxels(sensor: Sensor) -> tuple[int, ...]:
    """Return two opposite taxels and one between them, of the inner array if there is one."""
    columns, rows = sensor.taxels.columns, sensor.taxels.rows
    # At the rim the skin is softer to one side, which displaces the centre of an answer.
    i = (1, columns - 2) if columns >= 4 else (0, columns - 1)
    j = (1, rows - 2) if rows >= 4 else (0, rows - 1)
    corners = [(i[0], j[0]), (i[1], j[1]), ((i[0] + i[1]) // 2, j[1])]
    # In a small array some of the three coincide.
    return tuple(dict.fromkeys(a + columns * b for a, b in corners))


def touch_sites(sensor: Sensor) -> dict[str, tuple[float, float]]:
    """Return the centre and three corners of the taxel array [mm, sensor frame] by their names."""
    a, b = np.abs(sensor.taxels.centers).max(axis=0).tolist()
    # One place more than a plane needs: it shows a skin that is not flat.
    return {
        "the centre": (0.0, 0.0),
        "the corner -x -y": (-a, -b),
        "the corner +x -y": (a, -b),
        "the corner +x +y": (a, b),
    }


def described(sensor: Sensor, guess: Registration, settings: RegistrationSettings) -> str:
    """Describe the steps of the procedure."""
    half = np.abs(sensor.taxels.centers).max(axis=0)
    x, y, z = guess.origin
    taxels = settings.taxels or reference_taxels(sensor)
    return (
        f"registration of {sensor.name}: slow touches at the centre and three corners of the taxels, "
        f"then crosses of small presses over taxels {', '.join(map(str, taxels))}\n"
        f"expected skin at machine ({x:.2f}, {y:.2f}, {z:.2f}) mm, the taxels within {half[0]:.1f} x {half[1]:.1f} mm "
        f"of it\n"
        f"the search stops at the first answer, at the latest {settings.limit:g} mm below the expected skin, at "
        f"machine height {z - settings.limit:.2f} mm; later presses are {settings.depth:g} mm deep\n"
        "time: about 5 min"
    )


def register(
    probe: Probe,
    sensor: Sensor,
    guess: Registration,
    settings: RegistrationSettings,
    say: Callable[[str], None] = lambda t: None,
) -> Found:
    """Find the pose of the sensor.

    Args:
        probe: A spherical indenter, somewhere above the sensor.
        sensor: The sensor.
        guess: Where it is expected, within about a pitch, a few degrees and ``settings.limit``.
        settings: How far and how carefully.
        say: Called with a line of progress.

    Raises:
        DeviceError: If the sensor does not answer, is too noisy, not flat, too tilted, or not the one of its file.
    """
    noise = _noise(probe, guess, settings)
    say(f"noise without contact: {np.median(noise):.1f} counts (median of {len(noise)} channels)")
    touches = _with_one_power(_touches(probe, sensor, guess, settings, noise, say))
    plane = fit_plane(
        np.array([(t.x, t.y) for t in touches]),
        np.array([t.onset.height for t in touches]),
        np.array([t.onset.uncertainty for t in touches]),
    )
    _check_plane(plane, touches, settings)
    say(
        f"plane: tilted {np.degrees(np.hypot(*plane.slope)):.2f} deg, touches within "
        f"{1000 * np.abs(plane.residual).max():.0f} um of it"
    )
    # After the plane: depths of these presses count from it.
    crosses = _crosses(probe, sensor, guess, settings, plane, noise, say)
    centers = sensor.taxels.centers[[cross.taxel for cross in crosses]]
    motion = fit_rigid_motion(
        centers, np.array([(c.x, c.y) for c in crosses]), np.array([c.uncertainty for c in crosses])
    )
    _check_scale(motion.scale, centers)
    return Found(plane, motion, tuple(touches), tuple(crosses), noise, settings)


def _noise(probe: Probe, guess: Registration, settings: RegistrationSettings) -> np.ndarray:
    probe.go(guess.to_machine(0.0, 0.0, -settings.above), LIFT_SPEED)
    probe.wait(1.0)
    reading = probe.read(IDLE_FRAMES)
    if not (reading.spread > 0).any():
        raise DeviceError(
            "no channel changes at all while nothing is touched",
            "live channels with some noise",
            "check that the board sends fresh readings",
        )
    # A quiet channel may stay between two counts; the standard deviation of rounding alone is 0.3 counts.
    return np.maximum(reading.spread, 0.3)


def _touches(
    probe: Probe,
    sensor: Sensor,
    guess: Registration,
    settings: RegistrationSettings,
    noise: np.ndarray,
    say: Callable[[str], None],
) -> list[Touch]:
    touches: list[Touch] = []
    for name, (x, y) in touch_sites(sensor).items():
        mx, my, expected = guess.to_machine(x, y, 0.0)
        top, lowest = expected + settings.above, expected - settings.limit
        if touches:
            # The skin may be higher here, by a degree more tilt than is allowed.
            rise = float(np.hypot(x, y)) * np.tan(np.radians(settings.most_tilt + 1.0))
            top = min(top, touches[0].onset.height + expected - guess.origin[2] + QUIET_RISE + rise)
        above = max(top, touches[-1].onset.height + settings.above if touches else top)
        # First straight up, then sideways: a tilted skin may be higher at the next place.
        probe.go((touches[-1].x, touches[-1].y, above) if touches else (mx, my, above), LIFT_SPEED)
        probe.go((mx, my, above), LIFT_SPEED)
        touches += touch_off(probe, name, (mx, my), top, lowest, noise, settings.repeats)
        last = touches[-settings.repeats :]
        heights = ", ".join(f"{t.onset.height:.3f} +- {t.onset.uncertainty:.3f}" for t in last)
        say(f"{name}: first contact at machine height {heights} mm")
    return touches


def _with_one_power(touches: list[Touch]) -> list[Touch]:
    """Fit the onsets again with one common power; its error moves all heights by the same amount (`model`)."""
    power, doubt = shared_power([(t.height, t.answer) for t in touches])
    # Fits with the power off by its uncertainty show how far it moves the heights.
    powers = np.clip([power, power - doubt, power + doubt], POWERS[0], POWERS[-1]).tolist()
    fits = [[onset(t.height, t.answer, p) for p in powers] for t in touches]
    shifts = [abs(a.height - b.height) / 2 for _, a, b in fits if a and b]
    common = float(np.median(shifts)) if shifts else 0.0
    return [
        replace(t, onset=replace(fit[0], model=float(np.hypot(fit[0].model, common)))) if fit[0] else t
        for t, fit in zip(touches, fits, strict=True)
    ]


def _check_plane(plane: Plane, touches: list[Touch], settings: RegistrationSettings) -> None:
    tilt = float(np.degrees(np.arctan(np.hypot(*plane.slope))))
    if tilt > settings.most_tilt:
        raise DeviceError(
            f"the sensor is tilted by {tilt:.2f} deg against the guide",
            f"at most {settings.most_tilt:g} deg",
            "level its mount, then register again",
        )
    worst = int(np.argmax(np.abs(plane.residual)))
    if abs(plane.residual[worst]) > settings.flatness:
        raise DeviceError(
            f"the sensor is not flat: {touches[worst].site} lies {1000 * plane.residual[worst]:+.0f} um off the plane "
            "of the touches",
            f"at most {1000 * settings.flatness:g} um",
            "look for dirt, a lifted skin or a loose mount; a curved sensor cannot be registered to a plane",
        )
    # The error of the common power moves all touches equally: it does not average out.
    model = float(np.mean([touch.onset.model for touch in touches]))
    uncertainty = float(np.hypot(np.sqrt(plane.covariance[0, 0]), model))
    if uncertainty > settings.tolerance:
        raise DeviceError(
            f"the skin's height has a standard uncertainty of {1000 * uncertainty:.0f} um",
            f"at most {1000 * settings.tolerance:g} um",
            "reduce the noise, or touch more often with --repeats",
        )


def _crosses(
    probe: Probe,
    sensor: Sensor,
    guess: Registration,
    settings: RegistrationSettings,
    plane: Plane,
    noise: np.ndarray,
    say: Callable[[str], None],
) -> list[Cross]:
    taxels = settings.taxels or reference_taxels(sensor)
    # By the expected yaw: a few degrees off slant the lines, and leave the centre where it is.
    angle = np.radians(guess.yaw)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    pitch = sensor.taxels.pitch_x, sensor.taxels.pitch_y
    centers = [(float(cx), float(cy)) for cx, cy in sensor.taxels.centers]
    crosses: list[Cross] = []
    for taxel in taxels:
        x, y, _ = guess.to_machine(*centers[taxel], 0.0)
        # The other taxels are expected to be off by about as much as the first.
        if crosses:
            centre = guess.to_machine(*centers[crosses[0].taxel], 0.0)
            x, y = x + crosses[0].x - centre[0], y + crosses[0].y - centre[1]
        crosses.append(cross_scan(probe, taxel, (x, y), axes, pitch, plane.at, settings.depth, noise))
        say(f"taxel {taxel}: centre at machine ({crosses[-1].x:.3f}, {crosses[-1].y:.3f}) mm")
    return crosses


def _check_scale(scale: float, centers: np.ndarray) -> None:
    span = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).max())
    if span > 1.0 and abs(scale - 1) > 0.05:
        raise DeviceError(
            f"the taxels lie {scale:.3f} times as far apart as the sensor file says",
            "0.95 to 1.05",
            "check the sensor file's pitch and the guide's steps per millimetre ($100, $101)",
        )
