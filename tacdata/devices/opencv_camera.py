"""Cameras and what stands in for one, through OpenCV: device index, URL, video file or image folder."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import Camera, ImageFrame
from tacdata.errors import DeviceError

FIRST_IMAGE = 5.0
"""Longest wait for the first image [s, real time]."""
STALL = 3.0
"""A live camera without an image for so long has stalled [s of the clock, at least 2 s real time]."""
WAITING = 120
"""Images kept until they are read; beyond that the oldest are dropped and counted."""
IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")

Grab = Callable[[], np.ndarray | None]


class OpencvCamera(Camera):
    """A thread grabs and stamps; `read` hands out.

    Settings in the rig file: ``source``: index, URL, video file or image folder; ``rate`` [Hz]: nominal, and
    the pace of a file or folder (absent: the file's own, or 30); ``intrinsics``, whose size the images must
    have; ``cube``, which the tag room reads.
    """

    def __init__(
        self, clock: Clock, source: str | int, intrinsics: dict[str, Any], rate: float | None = None,
        cube: dict[str, Any] | None = None,
    ) -> None:  # fmt: skip
        """Keep the settings; see the class."""
        super().__init__(clock)
        self.source = int(source) if isinstance(source, str) and source.isdigit() else source
        self.intrinsics, self.cube, self.rate = intrinsics, cube, rate
        self.dropped = 0
        self._live = isinstance(self.source, int) or "://" in str(self.source)
        self._ended = False
        self._fault: DeviceError | None = None
        self._images: deque[ImageFrame] = deque()
        self._sequence = 0
        self._last_at = 0.0
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def describe(self) -> dict[str, Any]:
        """Return size, rate and source."""
        return {
            "kind": "camera", "driver": "opencv_camera", "source": self.source,
            "shape": [self.intrinsics["height"], self.intrinsics["width"]],
            "rate": {"nominal": self.rate, "unit": "Hz"},
        }  # fmt: skip

    def open(self) -> None:
        """Open the source and wait for the first image.

        Raises:
            DeviceError: If there is no such source, no image, or its size is not that of the intrinsics.
        """
        grab, release = self._open_source()
        self._images.clear()
        self._fault, self._ended, self._sequence, self.dropped = None, False, 0, 0
        self._stopped.clear()
        self._last_at = time.monotonic()
        self._thread = threading.Thread(target=self._run, args=(grab, release), name="camera", daemon=True)
        self._thread.start()
        with self._changed:
            self._changed.wait_for(lambda: self._images or self._fault or self._ended, FIRST_IMAGE)
            fault = self._fault
            shape = self._images[0].image.shape[:2] if self._images else None
        expected = (self.intrinsics["height"], self.intrinsics["width"])
        if shape is None:
            fault = fault or self._error(
                f"gave no image within {FIRST_IMAGE:g} s", "check the cable and the stream"
            )
        elif shape != expected:
            fault = self._error(
                f"gives {shape[1]} x {shape[0]} pixels, its intrinsics are for {expected[1]} x {expected[0]}",
                "calibrate at this size, or correct intrinsics in the rig file",
            )
        if fault:
            self.close()
            raise fault

    def close(self) -> None:
        """Stop; never raises. A grab that hangs is left to end by itself."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
            self._thread = None

    def read(self, timeout: float) -> list[ImageFrame]:
        """Return what has arrived, waiting at most ``timeout`` [s of the clock]; empty after a file's end.

        Raises:
            DeviceError: If the source broke or stalled, once everything before that has been handed out.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._images or self._fault, max(timeout, 0.0) / self.clock.rate)
            images = list(self._images)
            self._images.clear()
        if not images and self._fault:
            raise DeviceError(self._fault.given, self._fault.allowed, self._fault.remedy)
        silent = time.monotonic() - self._last_at
        if not images and self._live and silent > max(STALL / self.clock.rate, 2.0):
            raise self._error(
                f"has stalled: no image for {silent * self.clock.rate:.1f} s", "check cable, power, network"
            )
        return images

    def _run(self, grab: Grab, release: Callable[[], None]) -> None:
        begun = self.clock.now_ns()
        while not self._stopped.is_set():
            image = grab()
            arrival_ns = self.clock.now_ns()
            with self._changed:
                if image is None:
                    if self._live and not self._stopped.is_set():
                        self._fault = self._error("stopped sending images", "check cable, power, network")
                    self._ended = True
                    self._changed.notify_all()
                    break
                self._images.append(ImageFrame(arrival_ns, self._sequence, image))
                self._sequence += 1
                self._last_at = time.monotonic()
                if len(self._images) > WAITING:
                    self._images.popleft()
                    self.dropped += 1
                self._changed.notify_all()
            if not self._live:
                due = begun + round(self._sequence / (self.rate or 30.0) * 1e9)
                self._stopped.wait(max((due - self.clock.now_ns()) * 1e-9 / self.clock.rate, 0.0))
        release()

    def _open_source(self) -> tuple[Grab, Callable[[], None]]:
        import cv2

        if not self._live and Path(str(self.source)).is_dir():
            return self._open_folder(Path(str(self.source)))
        if isinstance(self.source, int):
            self._check_index(self.source)
        elif not self._live and not Path(self.source).is_file():
            raise self._error("does not exist", "correct source in the rig file")
        quiet = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            if isinstance(self.source, str) and self._live:
                limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 5000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 5000]
                capture = cv2.VideoCapture(self.source, cv2.CAP_FFMPEG, limits)
            else:
                capture = cv2.VideoCapture(self.source)
        finally:
            cv2.utils.logging.setLogLevel(quiet)
        if not capture.isOpened():
            capture.release()
            raise self._error("cannot be opened", "check that it is a camera, stream or video and not in use")
        if not self._live and self.rate is None:
            self.rate = capture.get(cv2.CAP_PROP_FPS) or 30.0

        def grab() -> np.ndarray | None:
            good, image = capture.read()
            return image if good else None

        return grab, capture.release

    def _open_folder(self, folder: Path) -> tuple[Grab, Callable[[], None]]:
        import cv2

        paths = iter(sorted(p for p in folder.iterdir() if p.suffix.lower() in IMAGE_ENDINGS))

        def grab() -> np.ndarray | None:
            path = next(paths, None)
            return None if path is None else cv2.imread(str(path), cv2.IMREAD_ANYCOLOR)

        return grab, lambda: None

    def _check_index(self, index: int) -> None:
        found = sorted(str(p) for p in Path("/dev").glob("video*"))
        if Path("/dev").is_dir() and not Path(f"/dev/video{index}").exists() and Path("/proc").is_dir():
            raise DeviceError(
                f"no camera {index}",
                f"a camera that exists: {', '.join(found) or 'this machine shows none'}",
                "plug it in, or correct source in the rig file",
            )  # fmt: skip

    def _error(self, what: str, remedy: str) -> DeviceError:
        return DeviceError(f"camera {self.source} {what}", "a source that delivers images", remedy)
