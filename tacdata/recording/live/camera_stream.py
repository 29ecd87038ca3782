"""Writes one camera's images to a recording, compressed, and searches them for tags as time allows."""

from __future__ import annotations

from concurrent.futures import Future, wait
from typing import Any

import numpy as np

from tacdata.devices.device import ImageFrame
from tacdata.errors import DeviceError
from tacdata.recording.files.writer import CubePoseRecord, EpisodeWriter
from tacdata.recording.live.detection_process import Detect

JPEG_QUALITY = 90
LIVED = 20
"""Images that must have differed before a repeated one counts as a camera that hangs [count]."""


class CameraStream:
    """Writes every image; searches the newest for tags when the previous search has ended.

    All images are in the file, so the search can be repeated on those that were skipped.
    """

    def __init__(
        self, name: str, entry: dict[str, Any], detect: Detect | None, fingers: dict[str, Any] | None = None
    ) -> None:
        """Prepare.

        Args:
            name: The camera's name.
            entry: Its entry in the rig file; its ``cube`` is searched.
            detect: The detector, if tags are to be searched.
            fingers: Fingers that a camera without ``cube`` searches (`schemas/fingers.schema.json`).
        """
        self.name, self._intrinsics = name, entry.get("intrinsics")
        self._cube = entry.get("cube")
        self._fingers = fingers if self._cube is None else None
        self._detect = detect if self._cube is not None or self._fingers is not None else None
        self._remarks: set[str] = set()
        self._image: tuple[bytes, np.ndarray] | None = None
        self._changes = 0
        self.is_frozen = False
        """Whether the latest image repeats the one before, of a camera whose images differed."""
        self._search: tuple[Future, ImageFrame, int, EpisodeWriter | None] | None = None
        self._last, self._asked = None, False
        self.ready = self._detect is None
        """Whether the detector has answered once (or there is none)."""

    def take(self, frame: ImageFrame, sample_ns: int, sink: EpisodeWriter | None) -> None:
        """Write one image with its estimated sample time [ns].

        Without a recording, a first one is searched, as a detector's first call takes long.

        Raises:
            DeviceError: If the image is not a valid picture.
        """
        if sink:
            # A camera's own JPEG is kept as it is: compressing again costs time and detail.
            jpeg = frame.jpeg or self._jpeg(frame)
            sink.image(self.name, frame.arrival_ns, sample_ns, frame.sequence, jpeg, frame.device_ns)
        self.collect(0.0)
        # One search at a time. Images that come meanwhile are stored without a pose.
        if self._detect is not None and self._search is None and (sink or not self._asked):
            search = self._detect(frame.image, self._intrinsics, self._fingers or self._cube, self._last)
            self._search, self._asked = (search, frame, sample_ns, sink), True

    def is_new(self, frame: ImageFrame) -> bool:
        """Return whether an image is a new one.

        A driver that hangs repeats its last image with fresh time stamps. A sensor never does, for its noise.
        """
        before, self._image = self._image, (frame.jpeg, frame.image)
        if before is None:
            return True
        # Equal bytes: two exposures of a live camera differ by noise.
        same = frame.jpeg == before[0] if frame.jpeg else np.array_equal(frame.image, before[1])
        self._changes += not same
        # A camera in the dark or with a static test picture never differed, so repeats prove nothing.
        self.is_frozen = bool(same) and self._changes >= LIVED
        return not self.is_frozen

    def collect(self, patience: float) -> None:
        """Write the pose of the search under way if it ends within ``patience`` [s of real time].

        A detector that fails is not called again. The recording continues without poses and logs that.
        """
        if self._search is None:
            return
        search, frame, sample_ns, sink = self._search
        if patience:
            wait([search], patience)
        if not search.done():
            return
        self._search, self.ready = None, True
        try:
            outcome = search.result()
            self._last = outcome.cubes if self._fingers else outcome
        except Exception as error:  # any error of a detector: the press goes on
            self._detect = None
            if sink:
                sink.note(f"camera {self.name}: the search for tags failed ({type(error).__name__}: {error})", "error")
            return
        if sink:
            self._write(sink, (frame.arrival_ns, sample_ns, frame.sequence), outcome)

    def _write(self, sink: EpisodeWriter, stamps: tuple[int, int, int], outcome: Any) -> None:
        if self._fingers is None:
            sink.cube(self.name, *stamps, _record(outcome))
            return
        for finger in self._fingers["fingers"]:
            sink.cube(self.name, *stamps, _record(outcome.tips.get(finger)), finger)
        for remark in set(outcome.remarks) - self._remarks:
            sink.note(f"camera {self.name}: {remark}", "warning")
            self._remarks.add(remark)

    def _jpeg(self, frame: ImageFrame) -> bytes:
        import cv2

        image = frame.image
        good = image.dtype == np.uint8 and image.size > 0 and (image.ndim == 2 or image.shape[2:] == (3,))
        if good:
            good, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not good:
            raise DeviceError(
                f"camera {self.name}: {image.dtype} image of shape {image.shape}",
                "grey or BGR uint8",
                "correct the camera's driver settings",
            )
        return data.tobytes()


def _record(pose: Any) -> CubePoseRecord | None:
    """Return a cube's or fingertip's pose as it is stored; missing values stay empty."""
    if pose is None:
        return None
    x, y, z = (float(value) for value in pose.position)
    qx, qy, qz, qw = (float(value) for value in pose.quaternion)
    cube = getattr(pose, "cube", pose)
    covariance = np.asarray(getattr(pose, "covariance", np.inf), float)
    return CubePoseRecord(
        (x, y, z),
        (qx, qy, qz, qw),
        float(cube.reprojection),
        int(cube.faces),
        tuple(getattr(cube, "ids", ())),
        bool(getattr(cube, "ambiguous", False)),
        tuple(covariance.ravel().tolist()) if covariance.shape == (6, 6) and np.isfinite(covariance).all() else (),
        tuple(getattr(cube, "strays", ())),
    )
