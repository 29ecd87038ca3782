"""Cameras and their substitutes, through OpenCV: device index, URL, video file or image folder."""

from __future__ import annotations

import re
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import Camera, ImageFrame, StreamCounts
from tacdata.errors import DeviceError, UsageError
from tacdata.wire.image_stream import stamped_stream

FIRST_IMAGE = 5.0
"""Timeout for the first image [s, real time]."""
STALL = 3.0
"""Time without an image after which a live camera counts as stalled [s of the clock, at least 2 s real time]."""
WAITING = 120
"""Images kept until they are read; if there are more, the oldest are dropped and counted."""
IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
BACKENDS = ("any", "v4l2", "dshow", "msmf", "avfoundation", "ffmpeg")
"""Names in a rig file; OpenCV's are ``CAP_ANY``, ``CAP_V4L2`` and so on."""
MANUAL_AUTOMATIC = {"V4L2": (1, 3)}
"""A back-end's values of manual and automatic exposure; the others use 0.25 and 0.75."""
BAD_IN_A_ROW = 10
"""Damaged images in a row that count as a broken source."""


@dataclass(frozen=True, eq=False)
class _Grabbed:
    """One item from a source."""

    image: np.ndarray | None
    """Grey or BGR, uint8; None if it is damaged."""
    jpeg: bytes = b""
    """The image as the source sent it, if that is a whole JPEG file."""
    device_ns: int = -1
    """The source's own time stamp [ns]; -1 without one."""


Grab = Callable[[], "_Grabbed | None"]


class OpencvCamera(Camera):
    """A camera or its substitute: a thread grabs and time-stamps images, `read` returns them.

    Settings in the rig file:

    - ``source``: index, URL, video file or image folder;
    - ``rate`` [Hz]: requested from a camera; the pace of a file or folder (default: the file's own, or 30);
    - ``intrinsics``: the camera's calibration; images must have its size;
    - ``cube``: the tag cube to search for (`tacdata.tags`);
    - ``loop``: begin a file or folder again at its end;
    - by index only: ``fourcc`` (default MJPG, since USB carries few images without compression), ``exposure`` [ms] or
      auto, ``gain``, ``backend``.
    """

    def __init__(
        self,
        clock: Clock,
        source: str | int,
        intrinsics: dict[str, Any],
        rate: float | None = None,
        cube: dict[str, Any] | None = None,
        fourcc: str = "MJPG",
        exposure: float | str = "auto",
        gain: float | None = None,
        backend: str = "any",
        loop: bool = False,
    ) -> None:
        """Keep the settings; see the class.

        Raises:
            UsageError: If a setting is invalid.
        """
        super().__init__(clock)
        self.source = int(source) if isinstance(source, str) and source.isdigit() else source
        self.intrinsics, self.cube, self.rate = intrinsics, cube, rate
        self.fourcc, self.exposure, self.gain, self.backend, self.loop = fourcc, exposure, gain, backend, loop
        self._check_settings()
        self.dropped = 0
        """Images that nobody fetched in time."""
        self.damaged = 0
        """Images that could not be decoded."""
        self.notes: list[str] = []
        """Settings that the camera did not take, as sentences."""
        self._live = isinstance(self.source, int) or "://" in str(self.source)
        self._ended = False
        self._fault: DeviceError | None = None
        self._images: deque[ImageFrame] = deque()
        self._sequence = 0
        self._last_at = 0.0
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def _check_settings(self) -> None:
        where = f"camera {self.source}"
        if self.backend not in BACKENDS:
            raise UsageError(f"{where}: backend {self.backend!r}", ", ".join(BACKENDS), "correct the rig file")
        if len(self.fourcc) != 4 or not self.fourcc.isascii():
            fault = f"{where}: fourcc {self.fourcc!r}"
            raise UsageError(fault, "four letters, for example MJPG or YUYV", "correct the rig file")
        is_time = isinstance(self.exposure, int | float) and self.exposure > 0
        if self.exposure != "auto" and not is_time:
            fault = f"{where}: exposure {self.exposure!r}"
            raise UsageError(fault, "auto, or a time above 0 ms", "correct the rig file")

    @property
    def counts(self) -> StreamCounts:
        """Images received, lost (not fetched in time) and corrupt; settings that were not accepted, as sentences."""
        with self._changed:
            return StreamCounts(self._sequence, self.dropped, 0, self.damaged, 0, list(self.notes))

    def describe(self) -> dict[str, Any]:
        """Return size, rate and source."""
        return {
            "kind": "camera",
            "driver": "opencv_camera",
            "source": self.source,
            "shape": [self.intrinsics["height"], self.intrinsics["width"]],
            "rate": {"nominal": self.rate, "unit": "Hz"},
        }

    def open(self) -> None:
        """Open the source and wait for the first image.

        Raises:
            DeviceError: If there is no such source, no image, or its size is not that of the intrinsics.
        """
        grab, release = self._open_source()
        self._images.clear()
        self._fault, self._ended, self._sequence, self.dropped, self.damaged = None, False, 0, 0, 0
        self._stopped.clear()
        self._last_at = self.clock.host.monotonic()
        self._thread = threading.Thread(target=self._run, args=(grab, release), name="camera", daemon=True)
        self._thread.start()
        with self._changed:
            self._changed.wait_for(lambda: self._images or self._fault or self._ended, FIRST_IMAGE)
            fault = self._fault if not self._images else None
            if not self._images and not fault:
                ended = "holds no image that can be read" if self._ended else f"gave no image in {FIRST_IMAGE:g} s"
                fault = self._error(ended, "check the cable and the stream, or the file")
        if fault:
            self.close()
            raise fault

    def close(self) -> None:
        """Stop; never raises. A grab that hangs ends by itself later."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
            self._thread = None

    def read(self, timeout: float) -> list[ImageFrame]:
        """Return the received images, waiting at most ``timeout`` [s of the clock]; empty after a file's end.

        Raises:
            DeviceError: If the source broke or stalled, once everything before that has been handed out.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._images or self._fault, max(timeout, 0.0) / self.clock.rate)
            images = list(self._images)
            self._images.clear()
        if not images and self._fault:
            raise DeviceError(self._fault.given, self._fault.allowed, self._fault.remedy)
        silent = self.clock.host.monotonic() - self._last_at
        if not images and self._live and silent > max(STALL / self.clock.rate, 2.0):
            raise self._error(
                f"has stalled: no image for {silent * self.clock.rate:.1f} s", "check cable, power, network"
            )
        return images

    def _run(self, grab: Grab, release: Callable[[], None]) -> None:
        begun, bad = self.clock.now_ns(), 0
        while not self._stopped.is_set():
            fault = None
            try:
                grabbed = grab()
            except DeviceError as error:
                grabbed, fault = None, error
            except Exception as error:  # a thread that died silently would look like a stalled camera
                grabbed, fault = None, self._error(f"failed ({error})", "report it with this line")
            arrival_ns = self.clock.now_ns()
            bad = bad + 1 if grabbed is not None and grabbed.image is None else 0
            if grabbed is None and self._live and not self._stopped.is_set():
                fault = fault or self._error("stopped sending images", "check cable, power, network")
            elif bad >= BAD_IN_A_ROW:
                fault = self._error(f"sent {bad} damaged images in a row", "check the cable; try another fourcc")
            elif grabbed is not None and grabbed.image is not None:
                fault = self._wrong_size(grabbed.image)
            with self._changed:
                if grabbed is None or fault:
                    self._fault, self._ended = self._fault or fault, True
                    self._changed.notify_all()
                    break
                self._keep(grabbed, arrival_ns)
            if not self._live:
                due = begun + round((self._sequence + self.damaged) / (self.rate or 30.0) * 1e9)
                self._stopped.wait(max((due - self.clock.now_ns()) * 1e-9 / self.clock.rate, 0.0))
        release()

    def _keep(self, grabbed: _Grabbed, arrival_ns: int) -> None:
        if grabbed.image is None:
            self.damaged += 1
            return
        frame = ImageFrame(arrival_ns, self._sequence, grabbed.image, grabbed.jpeg, grabbed.device_ns)
        self._images.append(frame)
        self._sequence += 1
        self._last_at = self.clock.host.monotonic()
        if len(self._images) > WAITING:
            self._images.popleft()
            self.dropped += 1
        self._changed.notify_all()

    def _wrong_size(self, image: np.ndarray) -> DeviceError | None:
        expected = (self.intrinsics["height"], self.intrinsics["width"])
        if image.shape[:2] == expected:
            return None
        which = f"image {self._sequence}: " if self._sequence else ""
        return self._error(
            f"gives {which}{image.shape[1]} x {image.shape[0]} pixels, its intrinsics are for "
            f"{expected[1]} x {expected[0]}",
            "calibrate at this size (tacdata calibrate-camera), or correct intrinsics in the rig file",
        )

    def _open_source(self) -> tuple[Grab, Callable[[], None]]:
        import cv2

        if not self._live and Path(str(self.source)).is_dir():
            return self._open_folder(Path(str(self.source)))
        if isinstance(self.source, int):
            self._check_index(self.source)
        elif not self._live and not Path(self.source).is_file():
            raise self._error("does not exist", "correct source in the rig file")
        if stamped := self._open_stamped():
            return stamped
        quiet = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            capture = self._capture()
        finally:
            cv2.utils.logging.setLogLevel(quiet)
        if not capture.isOpened():
            capture.release()
            raise self._error("cannot be opened", "check that it is a camera, stream or video and not in use")
        if isinstance(self.source, int):
            self._set_up(capture)
        elif not self._live and self.rate is None:
            self.rate = capture.get(cv2.CAP_PROP_FPS) or 30.0
        raw = self._ask_for_jpeg(capture)
        # A stream over HTTP without stamps has no clock: OpenCV invents times. A looped file begins again and again.
        timed = not str(self.source).startswith("http") and not self.loop

        def grab() -> _Grabbed | None:
            good, image = capture.read()
            if not good and self.loop and not self._live:
                capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
                good, image = capture.read()
            if not good:
                return None
            milliseconds = capture.get(cv2.CAP_PROP_POS_MSEC) if timed else 0.0
            device_ns = round(milliseconds * 1e6) if milliseconds > 0 or (timed and not self._live) else -1
            return _decoded(image.tobytes(), device_ns) if raw else _Grabbed(image, device_ns=device_ns)

        return grab, capture.release

    def _open_stamped(self) -> tuple[Grab, Callable[[], None]] | None:
        """Open a stream over HTTP whose images carry the time of their exposure; None for any other source."""
        # Longer than `STALL`, whose words are better; a virtual rig may take its time.
        limit = FIRST_IMAGE + self.clock.host.longest_wait
        stream = stamped_stream(str(self.source), limit) if str(self.source).startswith("http") else None
        if stream is None:
            return None

        def grab() -> _Grabbed | None:
            part = stream.read()
            return _decoded(part.data, part.device_ns) if part else None

        return grab, stream.close

    def _capture(self) -> Any:
        import cv2

        backend = getattr(cv2, f"CAP_{self.backend.upper()}")
        if isinstance(self.source, str) and self._live:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 5000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 5000]
            return cv2.VideoCapture(self.source, cv2.CAP_FFMPEG if backend == cv2.CAP_ANY else backend, limits)
        return cv2.VideoCapture(self.source, backend)

    def _set_up(self, capture: Any) -> None:
        """Set a camera's format, and note the settings that it does not accept."""
        import cv2

        width, height = self.intrinsics["width"], self.intrinsics["height"]
        settings: list[tuple[str, int, float]] = [
            ("fourcc", cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*self.fourcc)),
            ("width", cv2.CAP_PROP_FRAME_WIDTH, width),
            ("height", cv2.CAP_PROP_FRAME_HEIGHT, height),
        ]
        if self.rate:
            settings.append(("rate", cv2.CAP_PROP_FPS, self.rate))
        name = capture.getBackendName()
        manual, automatic = MANUAL_AUTOMATIC.get(name, (0.25, 0.75))
        if isinstance(self.exposure, int | float):
            # V4L2 counts 0.1 ms, the others powers of two of a second.
            value = 10 * self.exposure if name == "V4L2" else float(np.log2(self.exposure / 1000))
            settings += [
                ("manual exposure", cv2.CAP_PROP_AUTO_EXPOSURE, manual),
                ("exposure", cv2.CAP_PROP_EXPOSURE, value),
            ]
        else:
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, automatic)
        if self.gain is not None:
            settings.append(("gain", cv2.CAP_PROP_GAIN, self.gain))
        for what, key, value in settings:
            is_accepted = capture.set(key, value)
            if not is_accepted or abs(capture.get(key) - value) > 0.05 * abs(value) + 1e-6:
                self.notes.append(f"camera {self.source}: {what} {value:g} asked, {capture.get(key):g} given")
        # A buffer of one image: with more, each is older when it arrives.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def _ask_for_jpeg(self, capture: Any) -> bool:
        """Ask for JPEG files as they come, to store them without loss; return whether they will come so."""
        import cv2

        if int(capture.get(cv2.CAP_PROP_FOURCC)) != cv2.VideoWriter.fourcc(*"MJPG"):
            return False
        name = capture.getBackendName()
        if name == "FFMPEG":
            return bool(capture.set(cv2.CAP_PROP_FORMAT, -1))
        return name == "V4L2" and bool(capture.set(cv2.CAP_PROP_CONVERT_RGB, 0))

    def _open_folder(self, folder: Path) -> tuple[Grab, Callable[[], None]]:
        images = sorted((p for p in folder.iterdir() if p.suffix.lower() in IMAGE_ENDINGS), key=_by_number)
        if not images:
            endings = ", ".join(ending[1:] for ending in IMAGE_ENDINGS)
            raise DeviceError(f"camera {folder} holds no image", f"files of type {endings}", "correct source")
        paths = iter(images)

        def grab() -> _Grabbed | None:
            nonlocal paths
            path = next(paths, None)
            if path is None and self.loop:
                paths = iter(images)
                path = next(paths)
            if path is None:
                return None
            grabbed = _decoded(path.read_bytes())
            if grabbed.image is None:
                raise DeviceError(f"{path} cannot be read as an image", "whole image files", "replace or remove it")
            return grabbed

        return grab, lambda: None

    def _check_index(self, index: int) -> None:
        devices = sorted(str(p) for p in Path("/dev").glob("video*"))
        if Path("/dev").is_dir() and not Path(f"/dev/video{index}").exists() and Path("/proc").is_dir():
            raise DeviceError(
                f"no camera {index}",
                f"a camera that exists: {', '.join(devices) or 'this machine shows none'}",
                "plug it in, or correct source in the rig file",
            )

    def _error(self, what: str, remedy: str) -> DeviceError:
        return DeviceError(f"camera {self.source} {what}", "a source that delivers images", remedy)


def _decoded(data: bytes, device_ns: int = -1) -> _Grabbed:
    """Decode an image file. A JPEG without its end is damaged; one without Huffman tables is not stored as it came."""
    import cv2

    if data.startswith(b"\xff\xd8"):
        # FF D8 begins a JPEG file, FF D9 ends it.
        end = data.rfind(b"\xff\xd9")
        if end < 0:
            return _Grabbed(None, device_ns=device_ns)
        data = data[: end + 2]  # cameras pad their buffers
    flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    is_whole = data.startswith(b"\xff\xd8") and b"\xff\xc4" in data
    return _Grabbed(image, data if is_whole and image is not None else b"", device_ns)


def _by_number(path: Path) -> list[tuple[int, str]]:
    """Sort key that puts image-2 before image-10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
