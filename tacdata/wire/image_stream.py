"""Motion JPEG over HTTP, part by part, with the time stamp that its server sends.

A server such as mjpg-streamer or uStreamer puts a line ``X-Timestamp: seconds`` before every image: when the camera
took it, by the server's clock. OpenCV drops that line.
"""

from __future__ import annotations

import http.client
import urllib.request
from dataclasses import dataclass
from typing import BinaryIO

MULTIPART = "multipart/x-mixed-replace"
STAMPS = "x-timestamp", "x-time-stamp"
"""Names of the line with the time [s]."""
LONGEST = 32_000_000
"""Largest image [bytes]."""
HEADER = 4096
"""Longest line of a header [bytes]."""


@dataclass(frozen=True)
class ImagePart:
    """One image of a stream."""

    data: bytes
    """A JPEG file."""
    device_ns: int
    """When it was taken, by the server's clock [ns]; -1 without a stamp."""


class ImageStream:
    """An open stream of motion JPEG."""

    def __init__(self, url: str, timeout: float) -> None:
        """Open a stream and wait for its first image.

        Args:
            url: Its address, by HTTP.
            timeout: How long one read may take [s].

        Raises:
            OSError: If the server does not answer, or sends no motion JPEG with the length of each image.
        """
        try:
            self._answer = urllib.request.urlopen(url, timeout=timeout)
        except (http.client.HTTPException, ValueError) as error:
            raise OSError(str(error)) from error
        # Some servers put the boundary in quotes, or give its dashes with it.
        self._boundary = b"--" + str(self._answer.headers.get_param("boundary") or "").strip('"-').encode()
        # Whether images have time stamps is seen only in the first one.
        first = self._next() if self._answer.headers.get_content_type() == MULTIPART else None
        if first is None:
            self.close()
            raise OSError(f"{url} sends no motion JPEG")
        self._first: ImagePart | None = first
        self.stamped = first.device_ns >= 0
        """Whether the first image has a time stamp."""

    def read(self) -> ImagePart | None:
        """Return the next image; None at the stream's end."""
        first, self._first = self._first, None
        try:
            return first or self._next()
        except (OSError, http.client.HTTPException, ValueError):
            return None

    def close(self) -> None:
        """Close the connection."""
        self._answer.close()

    def _next(self) -> ImagePart | None:
        head = _head(self._answer, self._boundary)
        length = int(head.get("content-length", "-1"))
        # A damaged length must not make the reader wait for gigabytes.
        data = self._answer.read(length) if 0 <= length <= LONGEST else b""
        return ImagePart(data, _stamp(head)) if data and len(data) == length else None


def stamped_stream(url: str, timeout: float) -> ImageStream | None:
    """Return an open stream whose images carry time stamps; None where there is none at that address."""
    try:
        stream = ImageStream(url, timeout)
    except OSError:
        return None
    if not stream.stamped:
        stream.close()
        return None
    return stream


def _head(stream: BinaryIO, mark: bytes) -> dict[str, str]:
    """Return the lines before the next image, by their names in lower case; none at the stream's end."""
    fields: dict[str, str] = {}
    inside = False
    while line := stream.readline(HEADER):
        line = line.strip()
        # Some servers announce another boundary than they send.
        if line.startswith(mark) or (not inside and line.startswith(b"--")):
            inside, fields = True, {}
        elif inside and not line and fields:
            return fields
        elif inside and b":" in line:
            name, _, value = line.decode("latin-1").partition(":")
            fields[name.strip().lower()] = value.strip()
    return {}


def _stamp(head: dict[str, str]) -> int:
    for name in STAMPS:
        # As integers: a float of seconds since 1970 resolves 0.2 us.
        seconds, _, part = head.get(name, "").partition(".")
        if seconds.isdigit() and (part.isdigit() or not part):
            return int(seconds) * 1_000_000_000 + int(part.ljust(9, "0")[:9] or 0)
    return -1
