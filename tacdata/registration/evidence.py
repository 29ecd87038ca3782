"""One slow touch before anything goes deep: does the skin begin where the registration states?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tacdata.errors import DeviceError
from tacdata.plans import Press
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.registration.contact_search import COARSE, LIFT_SPEED, ContactSearch
from tacdata.registration.guarded_probe import probing
from tacdata.registration.probe import Position, Probe
from tacdata.registration.touch_off import first_touch
from tacdata.rig import Registration, Rig
from tacdata.sensor import Sensor

PROVED = 0.02
"""Agreement of touch and registration that proves the height [mm], besides the registration's own uncertainty."""
UNSTATED = 0.05
"""Standard uncertainty of a registration that states none [mm]."""
HALF_WIDTH = 4.0
"""Half width of a flat tip, whose edge touches a tilted skin first [mm]."""
FAR = 1.0
"""Step from the present height down to `NEAR` [mm]; no plan that is worth a touch presses less deep. A controller
without homing may have lost its place unseen, so no way down is trusted."""
NEAR = 1.0
"""Height above the expected skin from which steps are fine [mm]."""
BELOW = 0.3
"""How far below the lowest height that would agree the touch goes on [mm]: a weak answer shows late."""
IDLE_FRAMES = 30
"""Readings from which the noise is estimated [count]."""


@dataclass(frozen=True)
class Evidence:
    """Height of the skin by a touch, and by the registration."""

    expected: float
    """Depth zero at the touched place by the registration [mm, machine]."""
    height: float
    """First contact by the touch [mm, machine]."""
    uncertainty: float
    """Standard uncertainty of `height` [mm]."""
    limit: float
    """Largest difference that does not contradict the registration [mm]."""

    @property
    def difference(self) -> float:
        """First contact minus depth zero [mm]; positive where the skin begins higher than stated."""
        return self.height - self.expected

    @property
    def text(self) -> str:
        """The evidence as text."""
        return (
            f"zero proved by a touch: first contact {1000 * self.difference:+.0f} +- {1000 * self.uncertainty:.0f} um "
            f"from depth zero (at most {1000 * self.limit:.0f})"
        )


def difference_limit(registration: Registration, document: dict[str, object]) -> float:
    """Return the largest difference between touch and registration that is no contradiction [mm].

    Args:
        registration: Pose of the sensor.
        document: The rig file's entry, with its stated ``uncertainty`` or ``residual``.
    """
    stated = document.get("uncertainty")
    claim = stated["origin"][2] if isinstance(stated, dict) and "origin" in stated else document.get("residual")
    sigma = float(claim) if isinstance(claim, int | float) else UNSTATED
    # On a tilted skin the indenter's rim touches before its centre.
    return PROVED + 3.0 * sigma + HALF_WIDTH * float(np.hypot(*registration.tilt))


def touch_site(press: Press, sensor: Sensor, rig: Rig) -> tuple[float, float]:
    """Return the rig file's reference place, or the taxel nearest to a press [mm, sensor frame]."""
    if reference := rig.document.get("reference"):
        return reference["x"], reference["y"]
    centers = sensor.taxels.centers
    x, y = centers[int(np.argmin(np.linalg.norm(centers - [press.x, press.y], axis=1)))].tolist()
    return x, y


def touch_evidence(
    probe: Probe, start: Position, place: tuple[float, float], expected: float, limit: float
) -> Evidence:
    """Touch the skin at one place, slowly, and compare its height with the expected one.

    The way down is in steps, each ended by a reading at rest, and fine ones in the last millimetre: into a skin that
    begins higher than expected nothing goes deeper than one step.

    Args:
        probe: The indenter.
        start: Its position [mm, machine].
        place: x and y of the touch [mm, machine].
        expected: Height of the skin there [mm, machine].
        limit: Largest difference that is no contradiction [mm].

    Raises:
        DeviceError: If the skin answers elsewhere than expected, or not at all.
    """
    height = start[2]
    probe.go((*place, height), LIFT_SPEED)
    probe.wait(1.0)
    idle = probe.read(IDLE_FRAMES)
    # The standard deviation of rounding alone: a quiet channel may show one count throughout.
    noise = np.maximum(idle.spread, 0.3)
    # A guide that already stands lower than that begins with fine steps.
    near = min(height, expected + NEAR)
    far, fine = np.arange(height - FAR, near, -FAR), np.arange(near, expected - limit - BELOW, -COARSE)
    heights = [*far.tolist(), *fine.tolist()]
    search = ContactSearch(probe, place, height, heights, idle.mean, noise)

    def check(contact: float) -> None:
        # A step into the skin may have been a long one; the approach would go deeper.
        if contact > expected + NEAR - 1e-9:
            raise _contradiction(f"the skin answers already at machine height {contact:.2f} mm", expected, limit)

    touch = first_touch(search, probe, "the touch before the first press", place, heights[-1] - BELOW, noise, check)
    if touch is None:
        raise _contradiction(f"no channel answers down to machine height {heights[-1]:.2f} mm", expected, limit)
    sigma = float(np.hypot(touch.onset.uncertainty, touch.onset.model))
    evidence = Evidence(expected, touch.onset.height, sigma, limit)
    # The touch is uncertain too: only beyond both is it a contradiction.
    if abs(evidence.difference) > limit + 2.0 * sigma:
        observation = f"the skin is first touched at machine height {evidence.height:.3f} +- {sigma:.3f} mm"
        raise _contradiction(observation, expected, limit)
    return evidence


def prove_zero(
    rig: Rig,
    sensor: Sensor,
    press: Press,
    devices: RigDevices,
    streams: RigStreams,
    motion: GuardedMotion,
    interruption: Interruption,
    height: float,
    say: Callable[[str], None],
    position: Position,
) -> Position:
    """Touch the skin with the mounted indenter before the first press; return the guide's position then [mm].

    Args:
        rig: The rig.
        sensor: The skin.
        press: The first press; its indenter is mounted.
        devices: The open devices.
        streams: Their running streams.
        motion: Guide that moves.
        interruption: Holds Ctrl-C back.
        height: Safe machine height [mm].
        say: Called with the result in words.
        position: Position of the guide [mm, machine].

    Raises:
        DeviceError: If the touch contradicts the registration; the indenter was lifted.
    """
    registration = rig.registration_for(press.indenter_name)
    x, y, expected = registration.to_machine(*touch_site(press, sensor, rig), 0.0)
    limit = difference_limit(registration, rig.document["registration"])
    with probing(rig, devices, streams, motion, height, LIFT_SPEED, interruption, say, position) as probe:
        evidence = touch_evidence(probe, probe.position, (x, y), expected, limit)
    say(evidence.text)
    return probe.position


def _contradiction(observation: str, expected: float, limit: float) -> DeviceError:
    return DeviceError(
        f"{observation}, and depth zero is at {expected:.3f} mm by the registration: nothing goes deeper",
        f"a first contact within {limit:.3f} mm of depth zero",
        "see that the indenter sits as at the registration and the board answers; find the machine's zero again (home "
        "it, or touch off), or register again",
    )
