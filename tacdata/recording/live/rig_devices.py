"""The devices of a rig, opened and closed together."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from tacdata.devices.device import Camera, MotionController, TaxelBoard, create
from tacdata.rig import Rig


@dataclass(frozen=True)
class RigDevices:
    """Boards, cameras and controller of a rig."""

    cnc: MotionController
    board: TaxelBoard
    cameras: dict[str, Camera] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: Rig) -> RigDevices:
        """Build the drivers that the rig file names; nothing is opened yet."""
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
