"""A virtual demonstration: boards on three fingers, cameras on their cubes, and a demo rig file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.clock import Clock
from tacdata.errors import UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.paced_host import PacedHost
from tacdata.rig import Registration
from tacdata.sensor import Sensor, default_sensor
from tacdata.virtual_rig.board import VirtualBoard, draw_timing
from tacdata.virtual_rig.optics.camera import VirtualCamera
from tacdata.virtual_rig.optics.noise_stretch import NoiseStretch
from tacdata.virtual_rig.optics.scene import looking_at
from tacdata.virtual_rig.rig import BAUDS, PACE, board_format
from tacdata.virtual_rig.world.hand import DIRECTIONS, PERIOD, RADIUS, TASKS, THINGS, draw_hand
from tacdata.virtual_rig.world.world import World, draw

NAME = "virtual demonstration"
INTRINSICS = {"width": 800, "height": 600, "fx": 880.0, "fy": 880.0, "cx": 399.5, "cy": 299.5}
FACES = ("+x", "-x", "+y", "-y", "+z")
TIP = {"position": [10.0, 0.0, -18.0], "quaternion": [1.0, 0.0, 0.0, 0.0], "method": "drawing", "residual": 0.1}
EYES = {"left": (0.10, -0.36, 0.36), "right": (-0.08, 0.37, 0.35)}
"""Positions of the cameras [m]."""
AIM = (0.0, 0.0, 0.085)
"""Point that both cameras look at [m]: where the ball is lifted."""
RATE = 20.0
"""Images a second of the rig's clock [Hz]."""
DELAY = 0.05
"""Minimum latency from exposure to arrival of an image [s]; the rig file states it, as if a sync tap had measured it.
"""
SILENT_AFTER = 60.0
"""Time after which the fault "silent-finger" closes the middle finger's port [s of the rig's clock]."""
FAULTS = ("no-tag", "turned-tag", "swapped-fingers", "silent-finger")
"""Faults on demand: the index finger's tags covered for a second; its upper tag turned by 180 deg; the cubes of index
and middle finger exchanged; the middle finger's board silent after `SILENT_AFTER`.
"""
GRASPED = tuple(name for name in THINGS if name != "eraser")
"""Objects of the task grasp."""
NUBS = 1.0, 200.0
"""Smallest and largest radius of the nub that presses a skin [mm]."""
FACE_UP = "-x"


def cube(first: int) -> dict[str, Any]:
    """Return a cube [mm] whose tags are numbered from ``first``."""
    return {"side": 20.0, "tag": 16.0, "ids": {face: first + k for k, face in enumerate(FACES)}}


FINGERS: dict[str, Any] = {
    "version": "1.0",
    "fingers": {n: {"hand": "right", "finger": n, "cube": cube(5 * k), "tip": TIP} for k, n in enumerate(DIRECTIONS)},
}


class VirtualDemo:
    """Emulated boards and cameras; the pipeline sees only the demo rig file and the wires."""

    def __init__(
        self,
        directory: Path,
        speed: float = 1.0,
        seed: int = 0,
        cameras: int = 2,
        fault: str | None = None,
        sensor: Sensor | Mapping[str, Sensor] | None = None,
        task: str = "grasp",
        nub: float = RADIUS,
        thing: str | None = None,
    ) -> None:
        """Set up a hand whose clock runs ``speed`` times as fast as real time.

        Args:
            directory: Where ``demo_rig.yaml`` and ``truth.yaml`` are written.
            speed: Seconds of the rig per real second.
            seed: Decides grasp, skins, boards and camera errors.
            cameras: One or two.
            fault: One of `FAULTS`, or none.
            sensor: The skin on every finger, or finger -> skin; by default, and for fingers left out, the paper's.
            task: One of `TASKS`.
            nub: Radius of the nub that presses each skin [mm].
            thing: Object that is grasped, one of `GRASPED`; by default the ball, to wipe always the eraser.

        Raises:
            UsageError: If a number is out of range or there is no such fault, task or finger.
        """
        if not 0 < speed <= 8 or not 1 <= cameras <= len(EYES):
            raise UsageError(f"speed {speed:g}, {cameras} cameras", "above 0 to 8; 1 or 2 cameras", "choose others")
        if fault is not None and fault not in FAULTS:
            raise UsageError(f"fault {fault!r}", ", ".join(FAULTS), "name one of them")
        if task not in TASKS:
            raise UsageError(f"task {task!r}", ", ".join(TASKS), "name one of them")
        if thing is not None and (task == "wipe" or thing not in GRASPED):
            raise UsageError(
                f"object {thing!r} for task {task!r}", f"grasp with {', '.join(GRASPED)}", "choose another"
            )
        if not NUBS[0] <= nub <= NUBS[1]:
            raise UsageError(f"nubs of {nub:g} mm", f"{NUBS[0]:g} to {NUBS[1]:g} mm", "choose another radius")
        self.directory, self.path, self.fault, self.seed = directory, directory / "demo_rig.yaml", fault, seed
        self.hand = replace(draw_hand(seed, task, thing), nub=nub)
        self.host = PacedHost(directory / PACE, new=True)
        """Its computer, whose time waits for late devices."""
        self.clock, self.sensors = Clock.start(speed, self.host), _worn(sensor)
        self.start_ns = self.clock.now_ns()
        self.layouts = {name: board_format(skin) for name, skin in self.sensors.items()}
        self.boards = {name: self._board(name, k) for k, name in enumerate(DIRECTIONS)}
        self.eyes = {name: looking_at(EYES[name], AIM) for name in list(EYES)[:cameras]}
        self._noise = NoiseStretch(np.random.default_rng([seed, 12]))
        self.cameras = {
            name: VirtualCamera(self.clock, RATE, self._painter(pose), DELAY, seed, ahead=True)
            for name, pose in self.eyes.items()
        }

    @property
    def document(self) -> dict[str, Any]:
        """The demo rig file's document (`schemas/demo_rig.schema.json`)."""
        worlds = np.random.default_rng([self.seed, 13])
        return {
            "version": schemas.version("demo_rig"),
            "name": NAME,
            "clock": self.clock.document,
            "boards": {
                name: {
                    "driver": "capacitive_board",
                    "port": board.port.path,
                    "baud": board.baud,
                    "format": self.layouts[name].document,
                }
                for name, board in self.boards.items()
            },
            "sensors": {name: sensor.document for name, sensor in self.sensors.items()},
            "cameras": {
                name: {
                    "driver": "opencv_camera",
                    "source": camera.url,
                    "rate": RATE,
                    "intrinsics": dict(INTRINSICS),
                    "world": _world(name, self.eyes[name], worlds),
                }
                for name, camera in self.cameras.items()
            },
            "latencies": {
                f"camera {name}": {"latency_ns": int(DELAY * 1e9), "uncertainty_ns": 2_000_000, "source": "virtual tap"}
                for name in self.cameras
            },
            "fingers": FINGERS,
        }

    @property
    def emulates(self) -> list[str]:
        """Emulated devices, one line each."""
        boards = [f"{name:<7} {board.port.path}  {self.layouts[name].rate:g} Hz" for name, board in self.boards.items()]
        return [
            *boards,
            *(f"camera {name:<5} {camera.url}" for name, camera in self.cameras.items()),
            f"{self.hand.task} ({self.hand.thing}) every {PERIOD:g} s of its clock, which runs {self.clock.rate:g} "
            "times real time",
            *([f"fault: {self.fault}{_when(self.fault)}"] if self.fault else []),
        ]

    def seconds(self, time_ns: int) -> float:
        """Return the hand's time [s] at a time of the clock [ns]."""
        return (time_ns - self.start_ns) * 1e-9

    def start(self) -> None:
        """Switch everything on; the rig file comes last.

        Raises:
            UsageError: If a demo rig file is there already.
        """
        if self.path.exists():
            raise UsageError(f"{self.path} exists", "a directory without a demo rig", "choose another directory")
        self.directory.mkdir(parents=True, exist_ok=True)
        self.host.publish()
        truth = {
            "version": schemas.version("virtual_demo_truth"),
            "start_ns": self.start_ns,
            "fault": self.fault,
            "hand": self.hand.document,
            "cameras": {name: pose.tolist() for name, pose in self.eyes.items()},
        }
        documents.write(self.directory / "truth.yaml", truth, "virtual_demo_truth")
        for device in (*self.boards.values(), *self.cameras.values()):
            device.start()
        documents.write(self.path, self.document, "demo_rig")

    def stop(self) -> None:
        """Switch everything off and delete the rig file, whose ports are gone."""
        self.path.unlink(missing_ok=True)
        self.host.path.unlink(missing_ok=True)
        for device in (*self.cameras.values(), *self.boards.values()):
            device.stop()

    def _board(self, finger: str, number: int) -> VirtualBoard:
        layout, seed = self.layouts[finger], 10 * self.seed + number
        # Ten bits a byte, on a line that is busy for at most 0.8 of the time.
        baud = next((b for b in BAUDS if b >= layout.size * 10 * layout.rate / 0.8), BAUDS[-1])
        timing = draw_timing(seed, self.start_ns, layout.rate)
        return VirtualBoard(self.clock, layout, timing, self._reader(finger, number), baud, seed)

    def _reader(self, finger: str, number: int) -> Callable[[int], np.ndarray]:
        # The hand gives contacts in the pad's own frame: there is no guide to register.
        flat = Registration((0.0, 0.0, 0.0), 0.0)
        world = World(draw(100 * self.seed + number, self.sensors[finger], flat), self.sensors[finger])
        ball = Sphere(self.hand.nub)

        def read(sampled_ns: int) -> np.ndarray:
            seconds = self.seconds(sampled_ns)
            if self.fault == "silent-finger" and finger == "middle" and seconds > SILENT_AFTER:
                self.boards[finger].port.close()
            x, y, depth = self.hand.press(finger, seconds)
            return world.readings(np.array([x, y, -depth]), ball, 0.0, sampled_ns)

        return read

    def _painter(self, eye: np.ndarray) -> Callable[[int], np.ndarray]:
        from tacdata.virtual_rig.optics.render import render_scene

        world_to_eye, tip = np.linalg.inv(eye), tip_on_cube()

        def draw_image(exposed_ns: int) -> np.ndarray:
            seconds = self.seconds(exposed_ns)
            cubes = [
                (world_to_eye @ self.hand.tip(name, seconds) @ np.linalg.inv(tip), self._cube(name, seconds))
                for name in DIRECTIONS
            ]
            return render_scene(cubes, INTRINSICS, self._noise)

        return draw_image

    def _cube(self, finger: str, seconds: float) -> dict[str, Any]:
        names = {"index": "middle", "middle": "index"} if self.fault == "swapped-fingers" else {}
        carried = FINGERS["fingers"][names.get(finger, finger)]["cube"]
        t = seconds % PERIOD
        if finger == "index" and self.fault == "no-tag" and 4.0 < t < 5.0:
            return {**carried, "ids": {}}
        if finger == "index" and self.fault == "turned-tag":
            return {**carried, "turned": [FACE_UP]}
        return carried


def _worn(skins: Sensor | Mapping[str, Sensor] | None) -> dict[str, Sensor]:
    """Return each finger's skin; refuse skins of fingers that are not there."""
    if isinstance(skins, Sensor):
        return dict.fromkeys(DIRECTIONS, skins)
    strangers = sorted(set(skins or {}) - set(DIRECTIONS))
    if strangers:
        raise UsageError(f"a sensor for {', '.join(strangers)}", ", ".join(DIRECTIONS), "name one of these fingers")
    return {name: (skins or {}).get(name) or default_sensor() for name in DIRECTIONS}


def _when(fault: str) -> str:
    return f", {SILENT_AFTER:g} s of its clock after the start" if fault == "silent-finger" else ""


def tip_on_cube() -> np.ndarray:
    """Return the fingertip's frame in that of its cube, shape (4, 4) [m]."""
    matrix = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix[:3, 3] = np.array(TIP["position"]) / 1000
    return matrix


def _world(camera: str, pose: np.ndarray, rng: np.random.Generator) -> dict[str, Any]:
    """Return a camera's pose with the errors of a careful calibration: 0.2 mm and 0.03 degrees."""
    from scipy.spatial.transform import Rotation

    spread = 0.0002, float(np.radians(0.03))
    turn = Rotation.from_rotvec(rng.normal(0, spread[1], 3)) * Rotation.from_matrix(pose[:3, :3])
    return {
        "version": schemas.version("camera_world"),
        "camera": camera,
        "frame": "table",
        "position": (pose[:3, 3] + rng.normal(0, spread[0], 3)).tolist(),
        "quaternion": turn.as_quat().tolist(),  # ty: ignore[missing-union-attribute]
        "method": "virtual board",
        "poses": 1,
        "residual": {"position": spread[0], "rotation": spread[1]},
        "spread": {"position": spread[0], "rotation": spread[1]},
        "date": "2026-01-01",
        "code_version": provenance.code_version(),
    }
