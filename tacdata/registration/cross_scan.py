"""A cross of small presses over one taxel; returns the centre of its answer in the guide's frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tacdata.errors import DeviceError
from tacdata.registration.contact_search import LIFT_SPEED, SPEED
from tacdata.registration.probe import Probe
from tacdata.registration.symmetric_center import symmetric_center

PRESSES = 9
"""Presses along a line."""
REACH = 1.4
"""How far a line reaches to either side of the taxel [pitches]."""
CLEARANCE = 0.5
"""Height above the skin between the presses [mm]."""
FRAMES = 6
"""Readings averaged at each press, and at the rest before it [count]."""
RECOVERY = 0.5
"""Time above the skin before each press [s]."""


@dataclass(frozen=True)
class Cross:
    """Position of one taxel, as found by a cross of presses."""

    taxel: int
    x: float
    """Centre of its answer [mm, machine]."""
    y: float
    """Centre of its answer [mm, machine]."""
    uncertainty: tuple[float, float]
    """Standard uncertainty of x and y [mm]."""
    lines: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Places along each line [mm] and answers [counts], each of shape (presses,)."""


def cross_scan(
    probe: Probe,
    taxel: int,
    guess: tuple[float, float],
    axes: np.ndarray,
    pitch: tuple[float, float],
    surface: Callable[[float, float], float],
    depth: float,
    noise: np.ndarray,
) -> Cross:
    """Press along two lines over a taxel.

    Args:
        probe: The indenter, above the skin.
        taxel: Its number in the sensor file.
        guess: Expected position [mm, machine].
        axes: The sensor's x and y as unit vectors in the machine's frame [1], shape (2, 2), one a row.
        pitch: Distance of the taxels along the sensor's x and y [mm].
        surface: Height of the skin [mm, machine] at a place [mm, machine].
        depth: Depth of the presses [mm].
        noise: Standard deviation of a reading [counts], shape (channels,).

    Raises:
        DeviceError: If the taxel does not answer, or its answer has no centre on the line.
    """
    center = np.array(guess, dtype=float)
    lines, spread = [], []
    for axis, step in zip(axes, pitch, strict=True):
        # In a random order (always the same for a taxel), so that drift and the skin's memory favour no side.
        offsets = np.linspace(-REACH * step, REACH * step, PRESSES)
        order = np.random.default_rng(taxel).permutation(PRESSES)
        answer = np.zeros(PRESSES)
        for k in order.tolist():
            place = center + offsets[k] * axis
            answer[k] = _press(probe, place, surface(*place.tolist()), depth)[taxel]
        # An answer is the difference of two means of `FRAMES` readings each.
        fit = symmetric_center(offsets, answer, float(noise[taxel]) * np.sqrt(2 / FRAMES))
        if fit is None:
            raise _silent(taxel, answer, float(noise[taxel]))
        # The second line crosses the centre that the first line found.
        center = center + fit.place * axis
        lines.append((offsets, answer))
        spread.append(fit.uncertainty)
    # Variances along the two lines, as variances along the machine's axes.
    ux, uy = np.sqrt((axes.T**2) @ np.array(spread) ** 2).tolist()
    return Cross(taxel, float(center[0]), float(center[1]), (ux, uy), tuple(lines))


def _press(probe: Probe, place: np.ndarray, surface: float, depth: float) -> np.ndarray:
    """Return the change of every channel in one press [counts], shape (channels,)."""
    x, y = place.tolist()
    probe.go((x, y, surface + CLEARANCE), LIFT_SPEED)
    probe.wait(RECOVERY)
    baseline = probe.read(FRAMES).mean
    probe.go((x, y, surface - depth), SPEED)
    pressed = probe.read(FRAMES).mean
    probe.go((x, y, surface + CLEARANCE), LIFT_SPEED)
    return pressed - baseline


def _silent(taxel: int, answer: np.ndarray, noise: float) -> DeviceError:
    return DeviceError(
        f"taxel {taxel}: its largest answer to presses across it is {np.abs(answer).max():.1f} counts, "
        f"its noise {noise:.1f} counts, and it has no clear centre",
        "a taxel that answers most to presses over its own centre",
        "check whether that channel is dead or wired to another taxel; choose others with --taxel, or check origin "
        "and yaw in the rig file",
    )
