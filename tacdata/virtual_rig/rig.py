"""The whole virtual rig: controller, board and camera on one clock, and a rig file."""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import numpy as np

from tacdata import documents, schemas
from tacdata.clock import Clock
from tacdata.errors import UsageError
from tacdata.paced_host import PacedHost
from tacdata.rig import Registration
from tacdata.sensor import Sensor, default_sensor
from tacdata.virtual_rig.board import VirtualBoard, draw_timing
from tacdata.virtual_rig.firmware.controller import Controller
from tacdata.virtual_rig.optics.camera import VirtualCamera
from tacdata.virtual_rig.optics.noise_stretch import NoiseStretch
from tacdata.virtual_rig.optics.scene import CUBE, INTRINSICS, draw_scene
from tacdata.virtual_rig.world.hidden import HiddenWorld
from tacdata.virtual_rig.world.mounting import Mounted
from tacdata.virtual_rig.world.world import World, draw
from tacdata.wire import default_format
from tacdata.wire.frames.frame_format import FrameFormat, from_document

NAME = "virtual rig"
NOMINAL = Registration((-96.0, -61.5, -38.0), 1.2)
"""Position of the sensor as the lab's touch-off measured it."""
PARKED = 25.0
"""Height above the skin at which the machine waits [mm]."""
STATE = "machine_state"
"""Folder of the file that states where the machine was left."""
IMAGES = 30.0
"""Largest number of images rendered per real second."""
PACE = "pace"
"""File by which the clock waits for late devices."""
BAUDS = (115200, 230400, 460800, 921600, 2000000, 4000000)


def board_format(sensor: Sensor) -> FrameFormat:
    """Return the default frame format with a sensor's channels and frame rate."""
    base = default_format().document
    channels = {**base["channels"], "count": sensor.taxels.count}
    return from_document({**base, "channels": channels, "rate": sensor.taxels.rate}, "virtual board")


class VirtualRig:
    """Emulated devices and their world; the pipeline sees only the rig file and the wires.

    Files in its directory: ``rig.yaml`` while it runs, ``mounted.json`` (written by whoever mounts an indenter),
    ``truth.yaml`` (the true parameters; for tests only), ``machine_state/`` (where its machine was left).
    """

    def __init__(
        self,
        directory: Path,
        speed: float = 1.0,
        seed: int = 0,
        camera: bool = True,
        sensor: Sensor | None = None,
        rough: bool = False,
        hidden: dict[str, float] | None = None,
    ) -> None:
        """Set up a rig whose clock runs ``speed`` times as fast as real time; ``seed`` decides its world.

        With ``rough`` the sensor was put down by eye, up to a millimetre and some degrees off, and the rig file is not
        marked as registered. ``hidden``: kind -> size of effects that only truth.yaml names (`hidden.KINDS`).

        Raises:
            UsageError: If ``speed`` is not positive or too fast.
        """
        if not 0 < speed <= 100:
            raise UsageError(f"speed {speed:g}", "above 0, at most 100", "choose another speed (8 suits two cores)")
        self.directory, self.path = directory, directory / "rig.yaml"
        self._lock: IO[str] | None = None
        self.host = PacedHost(directory / PACE, new=True)
        """Its computer, whose time waits for late devices."""
        self.clock = Clock.start(speed, self.host)
        self.sensor = sensor or default_sensor()
        self.truth = draw(seed, self.sensor, NOMINAL, rough)
        self._rough = rough
        self._hidden = hidden or {}
        self.world = World(self.truth, self.sensor)
        if self._hidden:
            self.world = HiddenWorld(self.truth, self.sensor, self._hidden, directory)
        self.mounted = Mounted(directory / "mounted.json")
        parked = (NOMINAL.origin[0], NOMINAL.origin[1], NOMINAL.origin[2] + PARKED)
        self.controller = Controller(self.clock, seed, parked)
        layout = board_format(self.sensor)
        # Ten bits a byte, on a line that is busy for at most 0.8 of the time.
        needed = layout.size * 10 * layout.rate / 0.8
        baud = next((b for b in BAUDS if b >= needed), BAUDS[-1])
        timing = draw_timing(seed, self.clock.now_ns(), layout.rate)
        self.layout = layout
        self.board = VirtualBoard(self.clock, layout, timing, self._readings, baud, seed)
        self.scene = draw_scene(seed, NOMINAL.to_machine(0.0, 0.0, 0.0))
        self._noise = NoiseStretch(np.random.default_rng([seed, 7]))
        # Rendering takes real time, whatever the speed.
        rate = min(30.0, IMAGES / speed)
        self.camera = VirtualCamera(self.clock, rate, self._picture, seed=seed) if camera else None

    @property
    def document(self) -> dict[str, Any]:
        """The rig file's document (`schemas/rig.schema.json`)."""
        x, y, z = NOMINAL.origin
        half_x, half_y = self.sensor.skin.size_x / 2 + 2.5, self.sensor.skin.size_y / 2 + 2.5
        document: dict[str, Any] = {
            "version": schemas.version("rig"),
            "name": NAME,
            "clock": self.clock.document,
            "cnc": {"driver": "grbl", "port": self.controller.port.path, "baud": 115200},
            "board": {
                "driver": "capacitive_board",
                "port": self.board.port.path,
                "baud": self.board.baud,
                "format": self.layout.document,
            },
            "state_directory": str((self.directory / STATE).absolute()),
            "mounting": {"file": str(self.mounted.path.absolute())},
            "registration": {"origin": [x, y, z], "yaw": NOMINAL.yaw, **self._registered},
            "envelope": {
                "min": [x - half_x, y - half_y, z - 0.95 * self.sensor.skin.thickness],
                "max": [x + half_x, y + half_y, z + PARKED + 5],
            },
        }
        if self.camera:
            document["cameras"] = {
                "side": {
                    "driver": "opencv_camera",
                    "source": self.camera.url,
                    "rate": self.camera.rate,
                    "intrinsics": dict(INTRINSICS),
                    "cube": {**CUBE, "ids": dict(CUBE["ids"])},  # ty: ignore[no-matching-overload]
                }
            }
        return document

    @property
    def _registered(self) -> dict[str, Any]:
        if self._rough:
            return {}
        date = datetime.fromtimestamp(self.clock.epoch_ns * 1e-9, UTC).date().isoformat()
        return {"method": "virtual touch-off", "residual": 0.05, "date": date}

    @property
    def emulates(self) -> list[str]:
        """Emulated devices, one line each."""
        layout = self.layout
        lines = [
            f"motion controller  {self.controller.port.path}  GRBL 1.1",
            f"taxel board        {self.board.port.path}  {layout.channels} channels, {layout.rate:g} Hz",
        ]
        if self.camera:
            lines.append(f"camera             {self.camera.url}  {self.camera.rate:g} Hz")
        return [*lines, f"clock              {self.clock.rate:g} times real time"]

    def start(self) -> None:
        """Switch everything on. The rig file is written last, so that its readers find the devices too.

        Raises:
            UsageError: If another rig runs in the directory or another rig's file is there.
        """
        self._lock = _claim(self.directory, self.path)
        self.host.publish()
        camera = (
            {"rate": self.camera.rate, "start_ns": self.camera.start_ns, **self.scene.document} if self.camera else None
        )
        truth = {
            "version": schemas.version("virtual_truth"),
            "world": {**self.truth.document, "hidden": self._hidden},
            "board": asdict(self.board.timing),
            "camera": camera,
        }
        documents.write(self.directory / "truth.yaml", truth, "virtual_truth")
        self.mounted.start()
        for device in (self.controller, self.board, self.camera):
            if device:
                device.start()
        self._state_place()
        documents.write(self.path, self.document, "rig")

    def stop(self) -> None:
        """Switch everything off and delete the rig file, whose ports are gone."""
        # Without the lock the files are those of another rig.
        if self._lock:
            self.path.unlink(missing_ok=True)
            self.host.path.unlink(missing_ok=True)
        for device in (self.camera, self.board, self.controller):
            if device:
                device.stop()
        self.mounted.stop()
        if self._lock:
            self._lock.close()

    def _state_place(self) -> None:
        """Write the position of its machine, as a recorder that has homed it would: then nobody is asked."""
        shutil.rmtree(self.directory / STATE, ignore_errors=True)
        port = self.controller.port.path
        document = {
            "version": schemas.version("machine_state"),
            "port": port,
            "name": port,
            "controller": {"driver": "grbl", "firmware": self.controller.firmware.identity, "usb": ""},
            "number": 1,
            "written": datetime.now(UTC).isoformat(timespec="seconds"),
            "moving": False,
            "position": self.controller.position_at(self.clock.now_ns()).tolist(),
        }
        documents.write(self.directory / STATE / "virtual.json", document, "machine_state")

    def _readings(self, sampled_ns: int) -> np.ndarray:
        tip = self.controller.position_at(sampled_ns)
        return self.world.readings(tip, self.mounted.indenter, self.mounted.yaw, sampled_ns)

    def _picture(self, exposed_ns: int) -> np.ndarray:
        from tacdata.virtual_rig.optics.render import render_cube

        pose = self.scene.camera_cube(self.controller.position_at(exposed_ns))
        return render_cube(pose, INTRINSICS, CUBE, self._noise)


def _claim(directory: Path, path: Path) -> IO[str]:
    directory.mkdir(parents=True, exist_ok=True)
    if path.exists() and documents.read(path, "rig")["name"] != NAME:
        raise UsageError(f"{path} describes another rig", "a directory without one", "choose another directory")
    lock = (directory / ".virtual_rig.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise UsageError(
            f"a virtual rig is running in {directory}", "one rig per directory", "stop it or choose another directory"
        ) from None
    return lock


@contextmanager
def running(
    directory: Path,
    speed: float = 8.0,
    seed: int = 0,
    camera: bool = True,
    sensor: Sensor | None = None,
    rough: bool = False,
) -> Iterator[Path]:
    """Run a virtual rig in threads of this process; yields the path of its ``rig.yaml``."""
    rig = VirtualRig(directory, speed, seed, camera, sensor, rough)
    try:
        rig.start()
        yield rig.path
    finally:
        rig.stop()
