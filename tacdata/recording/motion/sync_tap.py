"""The motion of a sync tap: slow and quick touches of one taxel, no deeper than the plan presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.errors import UsageError
from tacdata.plans import Plan, Press
from tacdata.recording.motion.press_steps import SYNC, Step
from tacdata.rig import Registration
from tacdata.sensor import Sensor

DEPTH = 0.4
"""Depth of a touch [mm], if the plan presses that deep."""
LEAST = 0.1
"""Smallest useful depth [mm]: the uncertainty of a registration must be small against it."""
SLOW, QUICK = 1.0, 10.0
"""Speeds of the touches [mm/s]."""
TOUCHES = (SLOW, QUICK, QUICK, QUICK, QUICK, SLOW, QUICK, QUICK, QUICK, QUICK, SLOW)
"""Order of the touches; alternating, so that drift affects slow and quick ones equally."""
HELD = 0.15
"""Time at depth [s]."""
APART = (0.55, 0.083)
"""Rest before a touch, and the increment for each further one, so that sample times differ in phase [s]."""


def touch(plan: Plan, sensor: Sensor) -> Press:
    """Return the touch as a press: the first press's indenter on the taxel nearest to its site.

    Raises:
        UsageError: If the plan never presses deep enough to touch.
    """
    first = plan.presses[0]
    depth = min(DEPTH, max(press.depth for press in plan.presses if press.indenter_name == first.indenter_name))
    if depth < LEAST:
        raise UsageError(
            f"plan {plan.name} presses {first.indenter_name} to {depth:g} mm only",
            f"{LEAST:g} mm or more for a sync tap",
            "leave out --sync-tap, or put a deeper press into the plan",
        )
    centers = sensor.taxels.centers
    x, y = centers[int(np.argmin(np.linalg.norm(centers - [first.x, first.y], axis=1)))].tolist()
    return replace(first, x=x, y=y, depth=depth, speed=QUICK, hold=HELD)


def steps(tap: Press, plan: Plan, registration: Registration) -> tuple[Step, ...]:
    """Return the steps of the touches; every move starts from rest, as in a press."""
    motion = plan.motion
    above, near, deepest = (
        registration.to_machine(tap.x, tap.y, depth) for depth in (-motion.clearance, -motion.standoff, tap.depth)
    )
    path = [Step("", above, motion.travel_speed), Step("rest", seconds=max(motion.rest, 1.0))]
    for number, speed in enumerate(TOUCHES):
        # Pauses of different lengths: with equal ones a delay of one period would match as well.
        path += [Step("rest", seconds=APART[0] + APART[1] * (number % 5))]
        if speed == SLOW:
            path += [Step("approach", near, motion.approach_speed), Step("approach", seconds=SYNC)]
        path += [Step("press", deepest, speed), Step("hold", seconds=HELD)]
        path += [Step("release", above, QUICK), Step("release", seconds=SYNC)]
    return tuple(path)
