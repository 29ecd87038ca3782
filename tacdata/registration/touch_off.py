"""One touch-off: a quick search for the skin from above, then slow approaches over its first contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tacdata.errors import DeviceError
from tacdata.recording.onset import CLEAR, Onset, combined, onset
from tacdata.registration.contact_search import COARSE, LIFT_SPEED, SPEED, ContactSearch
from tacdata.registration.probe import Probe

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


class NoOnset(DeviceError):
    """An approach without a first contact."""

    def __init__(self, given: str, allowed: str, remedy: str, strength: float) -> None:
        """Besides the words, the answer at the lowest point [standard deviations]."""
        super().__init__(given, allowed, remedy)
        self.strength = strength


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
    contact: float
    """Height of the search's answer [mm, machine]."""


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
    probe.go((*place, top), LIFT_SPEED)
    probe.wait(RECOVERY / 2)
    idle = probe.read(2 * FRAMES).mean
    heights = np.arange(top - COARSE, lowest - 1e-9, -COARSE).tolist()
    search = ContactSearch(probe, place, top, heights, idle, noise)

    def check(contact: float) -> None:
        # The first step already, or the one below it.
        if contact >= top - 1.5 * COARSE:
            raise DeviceError(
                f"{site}: the sensor answers already {top - contact:.1f} mm below the start of the search, "
                f"at machine height {contact:.2f} mm",
                "a search that begins clear of the skin",
                "correct registration/origin (z) in the rig file, or start higher with --above",
            )

    touch = first_touch(search, probe, site, place, lowest, noise, check)
    if touch is None:
        probe.go((*place, top), LIFT_SPEED)
        raise DeviceError(
            f"{site}: no channel answered down to machine height {heights[-1]:.2f} mm, the limit",
            "a taxel that answers before the limit",
            "is the indenter mounted, the board connected, the place right? Correct registration/origin (z) in the "
            "rig file, or allow a deeper search with --limit",
        )
    contact = touch.contact
    touches = [touch, *(approach(probe, site, place, contact, lowest, noise) for _ in range(repeats - 1))]
    probe.go((*place, contact + HIGHER), LIFT_SPEED)
    return touches


def first_touch(
    search: ContactSearch,
    probe: Probe,
    site: str,
    place: tuple[float, float],
    lowest: float,
    noise: np.ndarray,
    check: Callable[[float], None],
) -> Touch | None:
    """Search and approach; go on below an answer that the approach finds free of contact.

    Args:
        search: The search.
        probe: The indenter.
        site: Name of the place, for errors.
        place: x and y [mm, machine].
        lowest: Height below which no approach goes [mm, machine].
        noise: Standard deviation of a reading [counts], shape (channels,).
        check: Called with the height of an answer [mm, machine]; raises where it can be no contact.

    Returns:
        The touch, or None if no channel answers down to the end of the search.

    Raises:
        DeviceError: If an approach begins in contact.
    """
    while (contact := search.first_answer()) is not None:
        check(contact)
        try:
            return approach(probe, site, place, contact, lowest, noise)
        except NoOnset as error:
            if error.strength >= CLEAR:
                raise
            search.go_on_below(max(contact - BELOW, lowest))
    return None


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
        NoOnset: If the answer shows no clear onset.
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
            return Touch(site, *place, first, heights, answer, contact)
    probe.go((*place, contact + HIGHER), LIFT_SPEED)
    raise NoOnset(
        f"{site}: the answer between {heights[0]:.2f} and {heights[-1]:.2f} mm shows no clear onset "
        f"({answer[-1]:.0f} standard deviations at the lowest point)",
        "an answer that begins within the approach and rises well above the noise",
        f"check for electrical noise (median {np.median(noise):.1f} counts) and a loose indenter, then register again",
        float(answer[-3:].mean() - answer[:3].mean()),
    )
