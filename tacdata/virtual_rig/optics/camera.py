"""An emulated network camera: MJPEG over HTTP on the loopback interface, rendered while somebody watches."""

from __future__ import annotations

import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np

from tacdata.clock import Clock

NS = 1_000_000_000
BOUNDARY = "image"
QUALITY = 92


class VirtualCamera:
    """Exposes `rate` times per second of ``clock`` and sends every image some tens of milliseconds later."""

    def __init__(
        self,
        clock: Clock,
        rate: float,
        draw: Callable[[int], np.ndarray],
        delay: float = 0.035,
        seed: int = 0,
        ahead: bool = False,
        stamps: bool = True,
    ) -> None:
        """Serve ``draw(exposure [ns]) -> uint8 (height, width)`` at ``rate`` [Hz] after a latency of ``delay`` [s].

        With ``ahead``, images are rendered before they are due, so that rendering adds no latency. The scene must then
        be known beforehand. With ``stamps``, the time of exposure goes before each image, as uStreamer sends it.
        """
        self.clock, self.rate, self.delay = clock, rate, delay
        self._draw, self._ahead, self._stamps = draw, ahead, stamps
        self._rng = np.random.default_rng([seed, 5])
        self.start_ns = clock.now_ns()
        self._image: tuple[int, bytes] = (-1, b"")
        self._watchers = 0
        self._stalled = False
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        # Port 0: the system chooses a free one, as several rigs may run side by side.
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_port}/stream.mjpg"
        self._threads = [
            threading.Thread(target=self._server.serve_forever, args=(0.1,), name="virtual-camera-http", daemon=True),
            threading.Thread(target=self._expose, name="virtual-camera", daemon=True),
        ]

    def start(self) -> None:
        """Switch on."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Switch off."""
        self._stopped.set()
        with self._changed:
            self._changed.notify_all()
        if self._threads[0].is_alive():
            self._server.shutdown()
            for thread in self._threads:
                thread.join(timeout=2.0)
        self._server.server_close()

    def inject_stall(self) -> None:
        """Fault: no further image comes; the connection stays open."""
        self._stalled = True

    def exposure_ns(self, number: int) -> int:
        """Return the true time of an exposure [ns]."""
        return self.start_ns + round(number / self.rate * NS)

    def _encoded(self, number: int) -> bytes:
        import cv2

        image = self._draw(self.exposure_ns(number))
        return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()

    def _expose(self) -> None:
        number, data = 0, b""
        while not self._stopped.is_set():
            due = self.exposure_ns(number) + int((self.delay + self._rng.uniform(0, 0.01)) * NS)
            self.clock.serve(self.url, due)
            drawn = self._ahead and self._watchers and not self._stalled
            if drawn:
                data = self._encoded(number)
            if self._stopped.wait(max((due - self.clock.now_ns()) / NS / self.clock.rate, 0.0)):
                break
            if self._watchers and not self._stalled:
                data = data if drawn else self._encoded(number)
                with self._changed:
                    self._image = (number, data)
                    self._changed.notify_all()
            # A camera that cannot keep up skips exposures; it does not fall behind.
            lag = int((self.clock.now_ns() - self.exposure_ns(number)) / NS * self.rate)
            number += max(1, lag)
        self.clock.serve(self.url, None)

    def _next(self, number: int) -> tuple[int, bytes] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._image[0] > number or self._stopped.is_set())
            return None if self._stopped.is_set() else self._image

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
                self.end_headers()
                camera._watchers += 1
                number = camera._image[0]
                try:
                    while item := camera._next(number):
                        number, data = item
                        head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n"
                        if camera._stamps:
                            seconds, part = divmod(camera.exposure_ns(number), NS)
                            head += f"X-Timestamp: {seconds}.{part // 1000:06d}\r\n"
                        head += "\r\n"
                        self.wfile.write(head.encode("ascii") + data + b"\r\n")
                        self.wfile.flush()
                except OSError:
                    pass  # the client disconnected
                finally:
                    camera._watchers -= 1

            def log_message(self, format: str, *args: object) -> None:
                pass

        return Handler
