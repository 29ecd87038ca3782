"""Topic names of a recording and the protobuf message of each: the only place that names topics."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from tacdata.schemas import tacdata_pb2

TAXELS = "/taxels"
STATUS = "/cnc/status"
MOTION = "/cnc/motion"
PHASE = "/phase"
LOG = "/log"
MEASURED = "/measured/"

FIXED: dict[str, Any] = {
    TAXELS: tacdata_pb2.Taxels,
    STATUS: tacdata_pb2.CncStatus,
    MOTION: tacdata_pb2.Motion,
    PHASE: tacdata_pb2.Phase,
    LOG: Log,
}
"""Channels of every recording."""


def taxels(board: str = "") -> str:
    """Return the topic of a board's readings; boards of a demonstration are named by finger."""
    return f"{TAXELS}/{board}" if board else TAXELS


def image(camera: str) -> str:
    """Return the topic of a camera's images."""
    return f"/camera/{camera}/image"


def measured(name: str) -> str:
    """Return the topic of a further measured quantity (`schemas/tacdata.proto`, message Measured)."""
    return f"{MEASURED}{name}"


def cube(camera: str) -> str:
    """Return the topic of the cube detections in each image."""
    return f"/camera/{camera}/cube"


def pose(camera: str) -> str:
    """Return the topic of the cube's poses."""
    return f"/camera/{camera}/pose"


def image_time(camera: str) -> str:
    """Return the topic of the times of images."""
    return f"/camera/{camera}/time"


def finger(camera: str, name: str) -> tuple[str, str]:
    """Return the topics of a finger's detections and of its tip's poses."""
    return f"/camera/{camera}/finger/{name}/view", f"/camera/{camera}/finger/{name}/pose"


def fingers(topics: Iterable[str], camera: str) -> tuple[str, ...]:
    """Return the fingers for which topics of a camera exist."""
    paths = (topic.split("/") for topic in topics)
    ours = ["", "camera", camera, "finger"]
    return tuple(sorted(parts[4] for parts in paths if parts[:4] == ours and parts[5:] == ["view"]))


def of_camera(camera: str, fingers: Iterable[str] = ()) -> dict[str, Any]:
    """Return the topics of one camera that looks at these fingers, by name."""
    channels = {
        image(camera): CompressedImage,
        image_time(camera): tacdata_pb2.ImageTime,
        cube(camera): tacdata_pb2.CubeView,
        pose(camera): PoseInFrame,
    }
    for name in fingers:
        view, tip = finger(camera, name)
        channels |= {view: tacdata_pb2.CubeView, tip: PoseInFrame}
    return channels
