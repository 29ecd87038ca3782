"""Taxel frames of a recording as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np

from tacdata.schemas import tacdata_pb2 as pb


@dataclass(frozen=True)
class TaxelFrames:
    """Frames of a board, in the order of writing."""

    arrival_ns: np.ndarray
    """Host times of receipt [ns], shape (n,), int64."""
    counter: np.ndarray
    """The device's frame counters [frames], shape (n,), int64; -1 without one."""
    device_ns: np.ndarray
    """The device's own times [ns], shape (n,), int64; -1 without one."""
    counts: np.ndarray
    """Raw readings [counts], shape (n, channels); without frames (0, 0)."""
    widths: tuple[int, ...]
    """Numbers of channels found, ascending. More than one means that frames contradict each other; then ``counts`` is
    empty.
    """


def taxel_frames(data: list[bytes]) -> TaxelFrames:
    """Return the frames of messages `Taxels`.

    Raises:
        google.protobuf.message.DecodeError: If a message is damaged.
    """
    frames = [pb.Taxels.FromString(message) for message in data]
    widths = tuple(sorted({len(frame.counts) for frame in frames}))
    # Frames of several widths have no common array; the caller refuses them by their widths.
    width = widths[0] if len(widths) == 1 else 0
    counts = chain.from_iterable(frame.counts for frame in frames) if width else ()
    return TaxelFrames(
        *(np.array([getattr(f, name) for f in frames], np.int64) for name in ("arrival_ns", "counter", "device_ns")),
        np.fromiter(counts, float).reshape(len(frames), width),
        widths,
    )
