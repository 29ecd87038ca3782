"""A demo rig file as immutable data (`schemas/demo_rig.schema.json`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.clock import Clock
from tacdata.demonstrations.camera_world import CameraWorld, check_worlds
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.sensor import Sensor, default_sensor
from tacdata.tags.camera import PinholeCamera
from tacdata.tags.fingers import Finger, fingers_of

CAMERA_FRAME = "camera "
"""Prefix of the frame name of a camera that was not calibrated to a world."""


@dataclass(frozen=True)
class DemoRig:
    """Boards on fingers and cameras that watch their cubes."""

    name: str
    boards: dict[str, dict[str, Any]]
    """Finger -> driver and settings of its board."""
    sensors: dict[str, Sensor]
    """Finger -> the sensor that it wears."""
    cameras: dict[str, dict[str, Any]]
    """Camera -> driver, settings, intrinsics."""
    worlds: dict[str, CameraWorld]
    """Camera -> its pose in the world; cameras that were not calibrated are missing."""
    fingers: dict[str, Finger]
    latencies: dict[str, StreamLatency]
    """Stream ("camera NAME", "taxels FINGER") -> its constant latency, where it was measured."""
    clock: Clock
    document: dict[str, Any]
    """The file's document including all files that it names, as attached to every recording."""

    @property
    def frame(self) -> str:
        """Name of the frame that poses are given in: the world's, or the only camera's own."""
        return next(iter(self.worlds.values())).frame if self.worlds else CAMERA_FRAME + next(iter(self.cameras))

    def camera_pose(self, camera: str) -> np.ndarray | None:
        """Return a camera's pose in `frame`, homogeneous, shape (4, 4) [m]; None if it is unknown."""
        if camera in self.worlds:
            return self.worlds[camera].matrix
        return np.eye(4) if self.frame == CAMERA_FRAME + camera else None


def demo_rig_of(document: dict[str, Any], origin: str) -> DemoRig:
    """Build a demo rig from a parsed file; files that it names are searched in the folder of ``origin``.

    Raises:
        UsageError: If a file that it names does not exist.
        FormatError: If the document breaks the schema or contradicts itself.
    """
    documents.check(document, "demo_rig", origin)
    folder = Path(origin).parent
    fingers = _inside(document["fingers"], "fingers", folder, f"{origin}: fingers")
    skins = {
        name: Sensor.from_document(_inside(content, "sensor", folder, f"{origin}: sensors/{name}"), f"{origin}: {name}")
        for name, content in document.get("sensors", {}).items()
    }
    cameras, worlds = {}, {}
    for name, entry in document["cameras"].items():
        PinholeCamera.from_document(entry["intrinsics"], f"{origin}: cameras/{name}/intrinsics")
        cameras[name] = {key: value for key, value in entry.items() if key != "world"}
        if "world" in entry:
            where = _inside(entry["world"], "camera_world", folder, f"{origin}: cameras/{name}/world")
            worlds[name] = CameraWorld.from_document(where, f"{origin}: cameras/{name}/world")
            cameras[name]["world"] = where
    named_fingers = fingers_of(fingers, f"{origin}: fingers")
    sensors = {name: skins.get(name) or default_sensor() for name in document["boards"]}
    document_with_files = {**document, "fingers": fingers, "cameras": cameras}
    document_with_files["sensors"] = {name: sensor.document for name, sensor in sensors.items()}
    _agree(document, named_fingers, worlds, origin)
    clock = Clock.from_document(document["clock"]) if "clock" in document else Clock.start()
    # Drivers know nothing of worlds.
    devices = {name: {k: v for k, v in entry.items() if k != "world"} for name, entry in cameras.items()}
    delays = {name: StreamLatency.from_document(entry) for name, entry in document.get("latencies", {}).items()}
    return DemoRig(
        document["name"],
        document["boards"],
        sensors,
        devices,
        worlds,
        named_fingers,
        delays,
        clock,
        document_with_files,
    )


def read_demo_rig(path: StrPath) -> DemoRig:
    """Read a demo rig file. Raises as `demo_rig_of`."""
    return demo_rig_of(documents.read(Path(path), "demo_rig"), str(path))


def _inside(entry: str | dict[str, Any], schema: str, folder: Path, origin: str) -> dict[str, Any]:
    """Return a checked document that is either given or named."""
    if isinstance(entry, str):
        return documents.read(folder / entry, schema)
    documents.check(entry, schema, origin)
    return entry


def _agree(document: dict[str, Any], fingers: dict[str, Finger], worlds: dict[str, CameraWorld], origin: str) -> None:
    for what in ("boards", "sensors"):
        strangers = sorted(set(document.get(what, {})) - set(fingers))
        if strangers:
            raise FormatError(
                f"{origin}: {what} of {', '.join(strangers)}, which carry no cube",
                ", ".join(fingers),
                "name boards and cubes by the same fingers",
            )
    streams = {f"taxels {name}" for name in document["boards"]} | {f"camera {name}" for name in document["cameras"]}
    unknown = sorted(set(document.get("latencies", {})) - streams)
    if unknown:
        fault = f"{origin}: a latency of {', '.join(unknown)}"
        raise FormatError(fault, ", ".join(sorted(streams)), "name the streams so")
    boardless = sorted(set(document.get("sensors", {})) - set(document["boards"]))
    if boardless:
        fault = f"{origin}: a sensor but no board for {', '.join(boardless)}"
        raise FormatError(fault, "sensors of fingers that have a board", "add the board, or leave the sensor out")
    check_worlds(worlds, origin)
    frames = sorted({world.frame for world in worlds.values()})
    if len(frames) > 1:
        raise FormatError(
            f"{origin}: cameras in several worlds ({', '.join(frames)})",
            "one frame for all cameras",
            "calibrate all cameras against the same robot or board",
        )
    # One camera can be the world itself; two without poses have no common frame.
    lost = sorted(set(document["cameras"]) - set(worlds))
    if lost and (worlds or len(lost) > 1):
        raise FormatError(
            f"{origin}: no pose is given for camera {', '.join(lost)}",
            "world for every camera, or one camera alone, whose frame is then the world",
            "run tacdata calibrate-world for it, and name the file as the camera's world",
        )
