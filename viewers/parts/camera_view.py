"""Cameras of an episode: images, pinhole and the cube's pose."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.recording.episode import Episode, TagStream
from tacdata.viewers.scene.scene import CameraView

AXIS_WITHOUT_SIDE = 20.0
"""Length of the drawn axes where the rig file gives no side of the cube [mm]."""


FINGER_AXES = 15.0
"""Length of a fingertip's drawn axes [mm]."""


def camera_views(episode: Episode, images: Iterable[tuple[str, int, bytes]]) -> tuple[CameraView, ...]:
    """Return one view for each camera that the rig file describes.

    Args:
        episode: Gives the intrinsics (rig file) and the cube's poses.
        images: Camera name, time of exposure [ns] and JPEG image, in any order.
    """
    frames = _by_camera(images)
    tags = {stream.camera: stream for stream in episode.tags}
    cameras = episode.rig.get("cameras", {})
    return tuple(_view(name, c, frames.get(name, []), tags.get(name)) for name, c in cameras.items())


def _by_camera(images: Iterable[tuple[str, int, bytes]]) -> dict[str, list[tuple[int, bytes]]]:
    frames: dict[str, list[tuple[int, bytes]]] = {}
    for name, time_ns, data in images:
        frames.setdefault(name, []).append((time_ns, data))
    return {name: sorted(entries) for name, entries in frames.items()}


def _view(
    name: str,
    camera: dict[str, Any],
    frames: list[tuple[int, bytes]],
    tags: TagStream | None,
    axes: float | None = None,
) -> CameraView:
    lens = camera["intrinsics"]
    matrix = np.array([[lens["fx"], 0, lens["cx"]], [0, lens["fy"], lens["cy"]], [0, 0, 1]], dtype=float)
    empty = np.zeros(0, dtype=np.int64)
    return CameraView(
        name=name,
        width=lens["width"],
        height=lens["height"],
        matrix=matrix,
        image_ns=np.array([t for t, _ in frames], dtype=np.int64),
        images=tuple(data for _, data in frames),
        cube_ns=tags.sample_ns if tags else empty,
        cube_position=1000 * tags.position if tags else np.zeros((0, 3)),
        cube_quaternion=tags.quaternion if tags else np.zeros((0, 4)),
        cube_side=axes or float(camera.get("cube", {}).get("side", AXIS_WITHOUT_SIDE)),
    )


def hand_views(recorded: DemoRecording, images: Iterable[tuple[str, int, bytes]]) -> tuple[CameraView, ...]:
    """Return one view for each camera of a demonstration, with the fingers that it saw.

    Args:
        recorded: Gives intrinsics and the fingertips' poses.
        images: Camera name, time of exposure [ns] and JPEG image, in any order.
    """
    frames, views = _by_camera(images), []
    for name, camera in recorded.rig.cameras.items():
        streams = [stream for stream in recorded.views if stream.camera == name]
        fingers = tuple(_view(f"{s.finger}", camera, [], s, FINGER_AXES) for s in streams)
        pose = recorded.rig.camera_pose(name)
        if pose is not None:
            pose = np.block([[pose[:3, :3], 1000 * pose[:3, 3:]], [pose[3:]]])
        views.append(replace(_view(name, camera, frames.get(name, []), None), fingers=fingers, pose=pose))
    return tuple(views)
