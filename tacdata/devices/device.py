"""Base classes of all drivers.

``tacdata/devices/my_device.py`` defines one class derived from `MotionController`, `TaxelBoard` or `Camera`. A rig file
names it by its file's name (``driver: my_device``) and hands its other settings to the constructor.

A driver answers `describe` before it is opened, and is a context manager. It never blocks longer than its timeout. It
stamps arrivals with the host's clock as early as it can. It counts lost and damaged data instead of hiding them.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from tacdata import registry
from tacdata.clock import Clock
from tacdata.errors import UsageError
from tacdata.wire.delivered import CncStatus, OwesAnswer, StandsStill, StreamCounts, TaxelFrame

ROOM, BASE = "tacdata.devices", "device"

__all__ = [
    "BASE",
    "ROOM",
    "Camera",
    "CncStatus",
    "Device",
    "ImageFrame",
    "Motion",
    "MotionController",
    "OwesAnswer",
    "StandsStill",
    "StreamCounts",
    "TaxelBoard",
    "TaxelFrame",
    "create",
]


@dataclass(frozen=True)
class Motion:
    """One acknowledged motion command."""

    line: str
    """The line as sent."""
    sent_ns: int
    """Host time at which it was sent [ns]."""
    acknowledged_ns: int
    """Host time of its `ok` [ns]."""


@dataclass(frozen=True)
class ImageFrame:
    """One camera image."""

    arrival_ns: int
    """Host time at which the image was received [ns]."""
    sequence: int
    """Number of the image since the camera was opened."""
    image: np.ndarray
    """Grey or BGR image, shape (height, width) or (height, width, 3), uint8."""
    jpeg: bytes = b""
    """The image as the camera sent it, if that was a JPEG file; it is stored without loss. Otherwise empty."""
    device_ns: int = -1
    """The camera's or driver's own time stamp of the image [ns of its clock]; -1 without one."""


class Device(ABC):
    """Base class: a device that is described before it is opened, and closed in any case."""

    def __init__(self, clock: Clock, **settings: Any) -> None:
        """Keep the settings of the rig file; do not open anything yet."""
        self.clock = clock

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the device's streams (channels, units, shapes, nominal rate), without opening it."""

    @abstractmethod
    def open(self) -> None:
        """Open the device.

        Raises:
            DeviceError: If the port is missing, busy or silent, or if another device answers.
        """

    @property
    def late(self) -> float:
        """Lateness in reading the device's bytes [s, real time]; 0 if nothing waits."""
        return 0.0

    @abstractmethod
    def close(self) -> None:
        """Close the device; never raises, may be called twice."""

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(self, *exception: object) -> None:
        """Close."""
        self.close()


class TaxelBoard(Device):
    """Base class of taxel boards, which stream frames of all channels."""

    counts: StreamCounts

    @abstractmethod
    def read(self, timeout: float) -> list[TaxelFrame]:
        """Return the frames that have arrived, waiting at most ``timeout`` [s of the host's clock]; may be empty."""


class MotionController(Device):
    """Base class of motion controllers with three axes."""

    before_homing: Callable[[], None] = staticmethod(lambda: None)
    """Called before `open` homes the machine; raises if it must not."""

    @abstractmethod
    def settings(self) -> dict[str, str]:
        """Return the controller's settings (banner, `$$`, `$I`, ...) as text, read at opening.

        The keys include ``banner``; GRBL-like numeric settings appear as ``$110`` etc.
        """

    @property
    @abstractmethod
    def acceleration(self) -> np.ndarray:
        """Acceleration limit of each axis [mm/s^2], shape (3,)."""

    @property
    @abstractmethod
    def max_rate(self) -> np.ndarray:
        """Speed limit of each axis [mm/s], shape (3,)."""

    @property
    def travel(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper corner of the controller's own limits [mm], shapes (3,) and (3,); None if it has none."""
        return None

    @property
    def cautions(self) -> tuple[str, ...]:
        """Remarks on its settings before the first move."""
        return ()

    @property
    def position_lost(self) -> str:
        """Reason for an unknown position, as a sentence; empty while it is known. Answered after `close` too."""
        return ""

    @property
    def alarm(self) -> str:
        """Reason of its lock, as a sentence. Empty if it was merely switched on."""
        return ""

    @property
    def unreadable(self) -> str:
        """The latest report if it could not be read, else nothing."""
        return ""

    @property
    def damaged_reports(self) -> int:
        """Status reports that could not be read since the port was opened [count]."""
        return 0

    def lose_position(self, why: str) -> None:
        """Take that its position is unknown from now on, and why, in words; a controller without memory forgets it."""

    def trust_position(self) -> None:
        """Take that its position is known again; a controller without memory forgets it."""

    @property
    def reported(self) -> tuple[float, float, float] | None:
        """Machine position of its latest report [mm]; None if it does not report any."""
        return None

    @property
    def moved(self) -> bool:
        """Whether any motion was commanded since creation, homing at opening included."""
        return False

    @abstractmethod
    def move(self, position: tuple[float, float, float], speed: float) -> Motion:
        """Queue a straight move to a machine position [mm] at ``speed`` [mm/s]; returns once it is acknowledged."""

    def rise(self, position: tuple[float, float, float], speed: float) -> Motion:
        """Queue a move straight up to ``position`` [mm, machine] at ``speed`` [mm/s].

        Where a controller can, x and y are not stated: if its report of them is wrong, a tip in the skin still moves
        up alone.
        """
        return self.move(position, speed)

    @abstractmethod
    def dwell(self, seconds: float) -> Motion:
        """Queue a pause [s of the controller's time]."""

    @abstractmethod
    def wait_idle(self, timeout: float) -> None:
        """Return when every queued motion is finished, polling the status meanwhile.

        Raises:
            DeviceError: On alarm, controller reset or when ``timeout`` [s of the host's clock] is over.
        """

    @abstractmethod
    def statuses(self) -> list[CncStatus]:
        """Return the status reports received since the last call (the driver polls in its own thread)."""

    def check(self) -> None:
        """Raise the error that occurred since the last call, if any.

        Raises:
            DeviceError: On a hold from outside, an alarm or a reset.
        """

    @abstractmethod
    def feed_hold(self) -> None:
        """Stop the motion now, keeping the position (real-time command); safe in any thread and signal handler.

        Until `resume` or `abandon` no line goes out, and a running `move`, `dwell` or `wait_idle` raises.
        """

    @abstractmethod
    def resume(self) -> None:
        """Go on after a feed hold."""

    @abstractmethod
    def abandon(self) -> tuple[float, float, float]:
        """After a feed hold: drop the queued motion, so that a retract can be sent.

        Returns:
            Machine position at rest [mm], read after the machine stopped.

        Raises:
            DeviceError: If the machine does not come to rest, or its position is unknown.
        """


class Camera(Device):
    """Base class of cameras."""

    @property
    def counts(self) -> StreamCounts:
        """Images so far: ``lost`` were not fetched in time, ``corrupt`` were damaged."""
        return StreamCounts()

    @abstractmethod
    def read(self, timeout: float) -> list[ImageFrame]:
        """Return the images that have arrived, waiting at most ``timeout`` [s of the host's clock]; may be empty."""


def create(settings: dict[str, Any], kind: type[Device], clock: Clock) -> Any:
    """Build the device that a rig file's entry describes (``{"driver": name, ...}``).

    Raises:
        UsageError: If no such driver exists, it has no such setting, or a setting is missing.
    """
    values = dict(settings)
    driver = values.pop("driver")
    maker = registry.load(ROOM, BASE, driver, kind)
    # The constructor's arguments are the settings that a rig file may give.
    parameters = {name: setting for name, setting in inspect.signature(maker).parameters.items() if name != "clock"}
    allowed = list(parameters)
    unknown = sorted(set(values) - set(allowed))
    if unknown:
        raise UsageError(
            f"driver {driver}: setting {', '.join(unknown)} in the rig file",
            ", ".join(allowed),
            "correct the name in the rig file",
        )
    missing = [
        name
        for name, setting in parameters.items()
        if setting.default is setting.empty and setting.kind is not setting.VAR_KEYWORD and name not in values
    ]
    if missing:
        raise UsageError(
            f"driver {driver} without {', '.join(missing)} in the rig file",
            ", ".join(allowed),
            f"add {missing[0]} below driver: {driver}",
        )
    return maker(clock=clock, **values)
