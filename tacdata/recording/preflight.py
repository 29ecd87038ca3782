"""What is going to happen, checked and said before the first move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import FormatError
from tacdata.plans import Plan
from tacdata.recording.motion_profile import AxisLimits
from tacdata.recording.press_steps import Position, duration, steps
from tacdata.rig import Rig
from tacdata.sensor import Sensor

SECONDS_PER_PRESS = 0.5
"""What acknowledgements and closing the file add to each press [s]; measured on the virtual rig."""


@dataclass(frozen=True)
class Preflight:
    """Summary of the motion to come."""

    plan: str
    """Name of the plan."""
    presses: int
    """Presses still to do."""
    total: int
    """Presses of the plan."""
    indenters: tuple[str, ...]
    """Names of the indenters in the order in which they are wanted, repeated when they come back."""
    deepest: float
    """Largest depth [mm]."""
    lower: Position
    """Smallest machine coordinates [mm]."""
    upper: Position
    """Largest machine coordinates [mm]."""
    seconds: tuple[float, ...]
    """Expected duration of each press [s]."""

    @property
    def text(self) -> str:
        """The summary in words."""
        bounds = ", ".join(
            f"{axis} {low:.2f} to {high:.2f}"
            for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)
        )
        minutes, seconds = divmod(round(sum(self.seconds)), 60)
        return (
            f"plan {self.plan}: {self.presses} of {self.total} presses, deepest {self.deepest:.2f} mm\n"
            f"indenters in order: {', '.join(self.indenters)}\n"
            f"machine bounds [mm]: {bounds}\n"
            f"time: about {minutes} min {seconds:02d} s"
        )


def preflight(plan: Plan, sensor: Sensor, rig: Rig, limits: AxisLimits, wanted: tuple[int, ...]) -> Preflight:
    """Check every commanded position against the envelope, every press against the skin, and sum up.

    Args:
        plan: The plan.
        sensor: The skin that is pressed.
        rig: Where it lies and where the guide may go.
        limits: The controller's axis limits.
        wanted: Numbers of the presses still to do.

    Raises:
        FormatError: Naming the first press that would leave the envelope, miss the skin or pierce it.
    """
    plan.check_against(sensor)
    corners, seconds, indenters = [], [], []
    position: Position | None = None
    for press in (plan.presses[k] for k in wanted):
        path = steps(press, plan.motion, rig.registration)
        for target in (step.target for step in path if step.target is not None):
            if not rig.envelope.contains(target):
                raise FormatError(
                    f"plan {plan.name}: presses/{press.index} needs machine position {_text(target)} mm",
                    f"{_text(rig.envelope.min)} to {_text(rig.envelope.max)} mm (the rig's envelope)",
                    "move the press, reduce the clearance, or correct the rig file",
                )
            corners.append(target)
        needed, position = duration(path, position or corners[0], limits)
        seconds.append(needed + SECONDS_PER_PRESS)
        if not indenters or indenters[-1] != press.indenter_name:
            indenters.append(press.indenter_name)
    bounds = np.array(corners) if corners else np.full((1, 3), np.nan)
    return Preflight(
        plan.name,
        len(wanted),
        len(plan.presses),
        tuple(indenters),
        max((plan.presses[k].depth for k in wanted), default=0.0),
        tuple(bounds.min(axis=0).tolist()),
        tuple(bounds.max(axis=0).tolist()),
        tuple(seconds),
    )


def _text(position: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"
