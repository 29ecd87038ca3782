"""Checks all motion before the first move, and sums it up for a person to confirm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import FormatError
from tacdata.plans import Plan, Press
from tacdata.recording.motion import sync_tap
from tacdata.recording.motion.press_steps import Position, duration, steps
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.rig import Envelope, Rig
from tacdata.sensor import Sensor

SECONDS_PER_PRESS = 0.5
"""Time that acknowledgements and closing the file add to each press [s]; measured on the virtual rig."""


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
    """Names of the indenters in the order of use; one that is used again is repeated."""
    deepest: float
    """Largest depth [mm]."""
    lower: Position
    """Smallest machine coordinates [mm]."""
    upper: Position
    """Largest machine coordinates [mm]."""
    seconds: tuple[float, ...]
    """Expected duration of each press [s]."""
    cautions: tuple[str, ...] = ()
    """Remarks on the controller's settings before the first move."""
    tap: str = ""
    """Description of the sync tap; empty without one."""
    height: float = float("nan")
    """Machine height to which the first move goes, straight up [mm]; NaN where there is none."""
    tools: str = ""
    """Tool offsets that are used, in words; empty without any."""

    @property
    def text(self) -> str:
        """The summary as text."""
        bounds = ", ".join(
            f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)
        )
        up = f"first move: straight up, to {self.height:.2f} mm or more; see that up is free\n"
        minutes, seconds = divmod(round(sum(self.seconds)), 60)
        return (
            f"plan {self.plan}: {self.presses} of {self.total} presses, deepest {self.deepest:.2f} mm\n"
            f"indenters in order: {', '.join(self.indenters)}\n"
            + (f"first {self.tap}\n" if self.tap else "")
            + (f"tool offsets [mm]: {self.tools}\n" if self.tools else "")
            + f"machine bounds [mm]: {bounds}\n"
            + (up if np.isfinite(self.height) else "")
            + f"time: about {minutes} min {seconds:02d} s"
            + "".join(f"\ncaution: {caution}" for caution in self.cautions)
        )


def preflight(
    plan: Plan,
    sensor: Sensor,
    rig: Rig,
    limits: AxisLimits,
    numbers: tuple[int, ...],
    travel: tuple[np.ndarray, np.ndarray] | None = None,
    cautions: tuple[str, ...] = (),
    tap: Press | None = None,
) -> Preflight:
    """Check every commanded position against envelope and soft limits, every press against the skin, and sum up.

    Args:
        plan: The plan.
        sensor: The skin that is pressed.
        rig: The rig: registration and envelope.
        limits: The controller's axis limits.
        numbers: Numbers of the presses still to do.
        travel: Machine box of the controller's soft limits [mm], shapes (3,) and (3,); None if they are off.
        cautions: Remarks before the first move.
        tap: The touch of a sync tap before the first press (`sync_tap.touch`), if there is one.

    Raises:
        FormatError: Naming the first press that would leave the envelope or the soft limits, miss the skin or
            pierce it.
    """
    plan.check_against(sensor)
    corners, seconds, indenters = [], [], []
    position: Position | None = None
    if tap is not None:
        path = sync_tap.steps(tap, plan, rig.registration_for(tap.indenter_name))
        corners += [step.target for step in path if step.target is not None]
        for target in corners:
            _refuse_outside(f"plan {plan.name}: the sync tap", target, rig.envelope, travel)
        needed, position = duration(path, corners[0], limits)
        seconds.append(needed)
        indenters.append(tap.indenter_name)
    for press in (plan.presses[k] for k in numbers):
        path = steps(press, plan.motion, rig.registration_for(press.indenter_name))
        for target in (step.target for step in path if step.target is not None):
            _refuse_outside(f"plan {plan.name}: presses/{press.index}", target, rig.envelope, travel)
            corners.append(target)
        needed, position = duration(path, position or corners[0], limits)
        seconds.append(needed + SECONDS_PER_PRESS)
        # An indenter is changed at the safe height; that position is checked too.
        if not indenters or indenters[-1] != press.indenter_name:
            indenters.append(press.indenter_name)
            change = (*(corners[-1] if len(indenters) > 1 else corners[0])[:2], safe_height(plan, rig))
            _refuse_outside(f"plan {plan.name}: mounting {press.indenter_name}", change, rig.envelope, travel)
    bounds = np.array(corners) if corners else np.full((1, 3), np.nan)
    return Preflight(
        plan.name,
        len(numbers),
        len(plan.presses),
        tuple(indenters),
        max((plan.presses[k].deepest for k in numbers), default=0.0),
        tuple(bounds.min(axis=0).tolist()),
        tuple(bounds.max(axis=0).tolist()),
        tuple(seconds),
        (*cautions, *_unknown_tools(rig, indenters)),
        _described(tap),
        safe_height(plan, rig),
        "; ".join(f"{name} {_text(tuple(rig.document['tools'][name]['offset']))}" for name in _tools(rig, indenters)),
    )


def safe_height(plan: Plan, rig: Rig) -> float:
    """Return the machine height [mm] at which every indenter of a plan clears the skin."""
    names = {press.indenter_name for press in plan.presses}
    return max(rig.registration_for(name).origin[2] for name in names) + plan.motion.clearance


def _tools(rig: Rig, indenters: list[str]) -> list[str]:
    return [name for name in dict.fromkeys(indenters) if name in rig.document.get("tools", {})]


def _unknown_tools(rig: Rig, indenters: list[str]) -> list[str]:
    """Name the indenters without a tool offset, if others have one."""
    names = [name for name in dict.fromkeys(indenters) if name not in _tools(rig, indenters)]
    if not names or "tools" not in rig.document:
        return []
    return [f"no tool offset for {', '.join(names)}: its tip has to sit where that of the registered indenter sat"]


def _described(tap: Press | None) -> str:
    if tap is None:
        return ""
    touches = len(sync_tap.TOUCHES)
    return (
        f"sync tap: {touches} touches with {tap.indenter_name} to {tap.depth:.2f} mm at ({tap.x:.2f}, {tap.y:.2f}) mm"
    )


def _refuse_outside(
    what: str, target: Position, envelope: Envelope, travel: tuple[np.ndarray, np.ndarray] | None
) -> None:
    boxes = {"the rig's envelope": (envelope.min, envelope.max)}
    if travel is not None:
        boxes["the controller's soft limits, $130 to $132"] = (tuple(travel[0].tolist()), tuple(travel[1].tolist()))
    for name, (lower, upper) in boxes.items():
        if not all(a <= value <= b for a, value, b in zip(lower, target, upper, strict=True)):
            raise FormatError(
                f"{what} needs machine position {_text(target)} mm",
                f"{_text(lower)} to {_text(upper)} mm ({name})",
                "move the press, reduce the clearance, or correct the rig file",
            )


def _text(position: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"
