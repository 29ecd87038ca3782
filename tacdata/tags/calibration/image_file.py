"""Reads the pixels of image files as the sensor wrote them, without the turn of their orientation tag."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
_TIFF = {b"II*\0": "<", b"MM\0*": ">"}
"""First bytes of a TIFF file -> its byte order."""
_ORIENTATION = 0x0112


def read_grey(path: Path) -> np.ndarray:
    """Return an image's pixels, grey uint8, shape (height, width).

    Raises:
        FormatError: If it cannot be read.
    """
    import cv2

    # A camera turned over keeps its optical centre: no turn is wanted.
    data = np.frombuffer(_unturned(path.read_bytes()), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if len(data) else None
    if image is None:
        raise FormatError(f"{path} cannot be read as an image", "whole image files", "replace or remove it")
    return image


def _unturned(data: bytes) -> bytes:
    """Return an image file whose orientation tag, if it is a TIFF, is 1: OpenCV obeys it there in any case."""
    order = _TIFF.get(data[:4])
    if order is None:
        return data
    try:
        (start,) = struct.unpack_from(order + "I", data, 4)
        (count,) = struct.unpack_from(order + "H", data, start)
        for entry in range(start + 2, start + 2 + 12 * count, 12):
            if struct.unpack_from(order + "H", data, entry)[0] == _ORIENTATION:
                return data[: entry + 8] + struct.pack(order + "H", 1) + data[entry + 10 :]
    except struct.error:
        pass  # cut off: OpenCV reports it
    return data
