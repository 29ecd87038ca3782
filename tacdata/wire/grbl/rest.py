"""Brings a moving machine to rest, and recognizes one that is."""

from __future__ import annotations

import numpy as np

from tacdata.errors import DeviceError
from tacdata.wire.delivered import CncStatus, StandsStill
from tacdata.wire.grbl.lines import AT_REST, BRAKING, MOVING
from tacdata.wire.grbl.link import GrblLink
from tacdata.wire.grbl.opening import ANSWER
from tacdata.wire.patience import Patience

COMING_TO_REST = 30.0
"""Longest deceleration of a feed hold [s of the clock]."""
STANDING = 3.0
"""A machine that reports the same place for so long is at rest, whatever state it reports [s of the clock]."""
LOOK = 0.05
"""Time between two reports that are compared [s, real time]."""


def in_motion(link: GrblLink) -> bool:
    """Return whether the latest report states a motion."""
    return link.last is not None and link.last.state.split(":")[0] in MOVING


def in_words(position: np.ndarray) -> str:
    """Return a position [mm], shape (3,), as "(x, y, z)"."""
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"


def come_to_rest(link: GrblLink) -> CncStatus:
    """Return a report of the machine at rest; a moving machine gets a feed hold.

    Raises:
        DeviceError: On a fault, or if it goes on moving.
    """
    clock = link.clock
    end = clock.now_ns() + round(COMING_TO_REST * 1e9)
    # A machine that says it moves and stays in one place is stalled or locked: waiting longer ends nothing.
    standing = Patience(STANDING, clock.rate, STANDING / 2, host=clock.host)
    place = np.full(3, np.nan)
    while True:
        status = link.fresh_status(ANSWER)
        is_moving, place = not np.array_equal(status.position, place), status.position
        state = status.state.split(":")[0]
        if state not in MOVING and status.state not in BRAKING:
            if not is_moving or status.state in AT_REST or state in AT_REST:
                return status  # a hold with another substate, or with none, may still brake
            clock.host.sleep(LOOK)
        if is_moving:
            standing.restart()
        elif standing.over() and state != "Door":
            raise StandsStill(
                f"the controller stays in state {status.state}; the machine stands at {in_words(place)} mm",
                "a controller that comes to rest",
                "look at it, then reset it and find its zero again",
            )
        if state in MOVING:
            # Sent at each look, as one byte can be lost; a second hold changes nothing.
            link.realtime(b"!")
        if clock.now_ns() > end:
            raise DeviceError(
                f"the machine is in state {status.state} {COMING_TO_REST:g} s after a feed hold",
                "a machine at rest",
                "press the emergency stop and look at it",
            )
