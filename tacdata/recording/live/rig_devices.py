"""The devices of a rig, opened and closed together."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from tacdata.devices.device import Camera, MotionController, TaxelBoard, create
from tacdata.errors import UsageError
from tacdata.rig import Rig
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class RigDevices:
    """Boards, cameras and controller of a rig."""

    cnc: MotionController
    board: TaxelBoard
    cameras: dict[str, Camera] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: Rig) -> RigDevices:
        """Build the drivers that the rig file names; nothing is opened yet.

        Raises:
            UsageError: If controller and board are on one port.
        """
        ports = rig.cnc.get("port"), rig.board.get("port")
        # By the real path: links in /dev/serial/by-id name the same port.
        if ports[0] and ports[1] and os.path.realpath(ports[0]) == os.path.realpath(ports[1]):
            same = ports[0] if ports[0] == ports[1] else f"{ports[0]} and {ports[1]}, which are one"
            raise UsageError(
                f"rig {rig.name}: the motion controller and the taxel board are both on port {same}",
                "a port for each of them",
                "correct port under cnc or under board in the rig file",
            )
        cameras = {name: create(entry, Camera, rig.clock) for name, entry in rig.cameras.items()}
        return cls(create(rig.cnc, MotionController, rig.clock), create(rig.board, TaxelBoard, rig.clock), cameras)

    @contextmanager
    def opened(self) -> Iterator[RigDevices]:
        """A context that opens all devices, the controller last, and closes all in any case."""
        with ExitStack() as stack:
            stack.enter_context(self.board)
            for camera in self.cameras.values():
                stack.enter_context(camera)
            stack.enter_context(self.cnc)
            yield self


def require_channels(board: TaxelBoard, sensor: Sensor, what: str = "the board", remedy: str = "--sensor") -> None:
    """Compare a board with the skin that is configured on it.

    Raises:
        UsageError: If it sends another number of channels than the sensor has taxels.
    """
    sent, expected = board.describe().get("channels"), sensor.taxels.count
    if sent is not None and sent != expected:
        raise UsageError(
            f"{what} sends {sent} channels, and the sensor {sensor.name} has {expected} taxels",
            "a channel for each taxel",
            f"name the skin's own file with {remedy}, or correct the board's format in the rig file",
        )
