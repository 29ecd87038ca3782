"""Depth maps as float32 TIFF 6.0 images, a whole episode at a time: one strip, no compression."""

import io
import struct

import numpy as np
import pyarrow as pa

MM_PER_METRE = np.float32(1000.0)


def _header(height: int, width: int) -> bytes:
    size = height * width * 4
    # Tag -> value; 339 = 3: floating point. The strip's start, 273, follows from the number of tags.
    longs = {256: width, 257: height, 273: 0, 278: height, 279: size}
    shorts = {258: 32, 259: 1, 262: 1, 277: 1, 339: 3}
    # (tag, type, value), by tag; type 3 is a 16-bit, 4 a 32-bit unsigned integer.
    fields = sorted([(tag, 4, v) for tag, v in longs.items()] + [(tag, 3, v) for tag, v in shorts.items()])
    # Padded to 16 bytes so that the strip of every frame starts aligned.
    start = -(-(8 + 2 + 12 * len(fields) + 4) // 16) * 16
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, start if tag == 273 else v) for tag, kind, v in fields)
    head = struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<H", len(fields)) + entries + struct.pack("<I", 0)
    return head.ljust(start, b"\0")


def encode(maps: np.ndarray) -> pa.StructArray:
    """Return maps as LeRobot's image column.

    Args:
        maps: Float32 maps in the unit to be stored, shape (n, height, width).

    Returns:
        Struct column of ``bytes`` (one TIFF a row) and ``path`` (null), length n.
    """
    n, height, width = maps.shape
    header = np.frombuffer(_header(height, width), dtype=np.uint8)
    size = len(header) + height * width * 4
    images = np.empty((n, size), dtype=np.uint8)
    images[:, : len(header)] = header
    images[:, len(header) :] = np.ascontiguousarray(maps, dtype="<f4").reshape(n, -1).view(np.uint8)
    offsets = np.arange(n + 1, dtype=np.int32) * np.int32(size)
    content = pa.Array.from_buffers(pa.binary(), n, [None, pa.py_buffer(offsets), pa.py_buffer(images)])
    return pa.StructArray.from_arrays([content, pa.nulls(n, pa.string())], ["bytes", "path"])


def decode(column: pa.Array, shape: tuple[int, int]) -> np.ndarray:
    """Return the maps of an image column, in the stored unit.

    Args:
        column: Struct column of ``bytes`` and ``path``.
        shape: Height and width that every image must have.

    Returns:
        Float32 maps, shape (n, height, width).

    Raises:
        ValueError: If an image is missing, unreadable, or of another size or type.
    """
    content = column.field("bytes") if isinstance(column, pa.StructArray) else column
    if content.null_count:
        raise ValueError(f"{content.null_count} depth images are missing")
    blobs = content.to_pylist()
    if not blobs:
        return np.empty((0, *shape), dtype=np.float32)
    first = blobs[0]
    start = _strip_start(first, shape)
    # Images of ours share their header: decoded together, they need no image library.
    if start is not None and all(len(blob) == len(first) for blob in blobs):
        images = np.frombuffer(b"".join(blobs), dtype=np.uint8).reshape(len(blobs), len(first))
        end = start + shape[0] * shape[1] * 4
        same = (images[:, :start] == images[0, :start]).all() and (images[:, end:] == images[0, end:]).all()
        if same:
            return np.ascontiguousarray(images[:, start:end]).view("<f4").reshape(-1, *shape).astype(np.float32)
    return np.stack([_decode_one(blob, shape) for blob in blobs])


def _strip_start(blob: bytes, shape: tuple[int, int]) -> int | None:
    """Return where the one uncompressed float32 strip starts, or None if the image is of another make."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(blob)) as image:
            tags = getattr(image, "tag_v2", {})
            plain = image.mode == "F" and image.size == shape[::-1] and tags.get(259) == 1 and blob[:2] == b"II"
            starts = tags.get(273, ())
    except OSError as error:
        raise ValueError(f"a depth image is unreadable: {error}") from None
    is_complete = plain and len(starts) == 1 and starts[0] + shape[0] * shape[1] * 4 <= len(blob)
    return int(starts[0]) if is_complete else None


def _decode_one(blob: bytes, shape: tuple[int, int]) -> np.ndarray:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(blob)) as image:
            values = np.asarray(image)
    except (OSError, SyntaxError) as error:
        raise ValueError(f"a depth image is unreadable: {error}") from None
    if values.shape != shape or values.dtype != np.float32:
        raise ValueError(f"a depth image is {values.dtype} {values.shape}, not float32 {shape}")
    return values
