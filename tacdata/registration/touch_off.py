"""One touch-off: a quick search for the skin from above, then slow approaches over its first contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import DeviceError
from tacdata.recording.onset import Onset, combined, onset
from tacdata.registration.probe import Probe

COARSE = 0.1
"""Step of the search [mm]."""
FINE = 0.02
"""Step of the slow approach [mm]."""
ABOVE, BELOW = (0.28, 0.6), 0.12
"""Begin (first and second try) and end of the slow approach, relative to the search's contact [mm]."""
HIGHER = 0.4
"""How far the indenter is lifted between the approaches [mm]."""
RECOVERY = 2.0
"""Recovery time of the skin before each approach [s]."""
FRAMES = 6
"""Readings averaged at each step [count]."""
ANSWER = 7.0
"""Minimum answer of a channel [standard deviations of a step's mean], needed twice in a row."""
SPEED, LIFT_SPEED = 1.0, 5.0
"""Speeds downwards and upwards [mm/s]."""


@dataclass(frozen=True)
class Touch:
    """First contact at one place."""

    site: str
    """Name of the place."""
    x: float
    """Place [mm, machine]."""
    y: float
    """Place [mm, machine]."""
    onset: Onset
    height: np.ndarray
    """Heights of the approach [mm], shape (n,)."""
    answer: np.ndarray
    """The channels' combined answer [standard deviations], shape (n,)."""


def touch_off(
    probe: Probe, site: str, place: tuple[float, float], top: float, lowest: float, noise: np.ndarray, repeats: int
) -> list[Touch]:
    """Touch the skin at one place; the indenter is above it before and afterwards.

    Args:
        probe: The indenter.
        site: Name of the place, for errors.
        place: x and y [mm, machine].
        top: Height from which the search begins [mm, machine], above the skin.
        lowest: Height below which the search never goes [mm, machine].
        noise: Standard deviation of a reading [counts], shape (channels,).
        repeats: Number of slow approaches.

    Raises:
        DeviceError: If nothing answers down to the limit, or something does already at the top, or the
            answer shows no clear onset.
    """
    contact = search(probe, site, place, top, lowest, noise)
    touches = [approach(probe, site, place, contact, lowest, noise) for _ in range(repeats)]
    probe.go((*place, contact + HIGHER), LIFT_SPEED)
    return touches


def approach(
    probe: Probe, site: str, place: tuple[float, float], contact: float, lowest: float, noise: np.ndarray
) -> Touch:
    """Approach slowly around the height at which the search was answered; from higher where that began in contact.

    Args:
        probe: The indenter.
        site: Name of the place, for errors.
        place: x and y [mm, machine].
        contact: Height of the search's first answer [mm, machine].
        lowest: Height below which the approach never goes [mm, machine].
        noise: Standard deviation of a reading [counts], shape (channels,).

    Raises:
        DeviceError: If the answer shows no clear onset.
    """
    for above in ABOVE:
        # Always from above, so that the drive's play is taken up on the same side.
        probe.go((*place, contact + max(above, HIGHER)), LIFT_SPEED)
        # The skin is still dented by the touch before.
        probe.wait(RECOVERY)
        heights = np.arange(contact + above, max(contact - BELOW, lowest) - 1e-9, -FINE)
        readings = []
        for height in heights.tolist():
            probe.go((*place, height), SPEED)
            readings.append(probe.read(FRAMES).mean)
        answer = combined(np.array(readings), noise / np.sqrt(FRAMES))
        if first := onset(heights, answer):
            return Touch(site, *place, first, heights, answer)
    probe.go((*place, contact + HIGHER), LIFT_SPEED)
    raise DeviceError(
        f"{site}: the answer between {heights[0]:.2f} and {heights[-1]:.2f} mm shows no clear onset "
        f"({answer[-1]:.0f} standard deviations at the lowest point)",
        "an answer that begins within the approach and rises well above the noise",
        f"check for electrical noise (median {np.median(noise):.1f} counts) and a loose indenter, then register again",
    )


def search(probe: Probe, site: str, place: tuple[float, float], top: float, lowest: float, noise: np.ndarray) -> float:
    """Go down in steps until a channel answers twice in a row; return the height of the first answer [mm]."""
    probe.go((*place, top), LIFT_SPEED)
    probe.wait(RECOVERY / 2)
    # More frames than at a step: every later difference contains this noise.
    baseline = probe.read(2 * FRAMES).mean
    limit = ANSWER * noise / np.sqrt(FRAMES / 2)
    height, first = top, None
    while height - COARSE >= lowest:
        height -= COARSE
        probe.go((*place, height), SPEED)
        answers = bool((np.abs(probe.read(FRAMES // 2 + 1).mean - baseline) > limit).any())
        # Two answers in a row: a single one may be noise.
        if answers and first is not None:
            if first >= top - 1.5 * COARSE:
                raise DeviceError(
                    f"{site}: the sensor answers already {top - first:.1f} mm below the start of the search, "
                    f"at machine height {first:.2f} mm",
                    "a search that begins clear of the skin",
                    "correct registration/origin (z) in the rig file, or start higher with --above",
                )
            return first
        first = height if answers else None
    probe.go((*place, top), LIFT_SPEED)
    raise DeviceError(
        f"{site}: no channel answered down to machine height {height:.2f} mm, the limit",
        "a taxel that answers before the limit",
        "is the indenter mounted, the board connected, the place right? Correct registration/origin (z) in the "
        "rig file, or allow a deeper search with --limit",
    )
