"""Taxel frames of a recording as arrays, decoded many messages at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.schemas import tacdata_pb2 as pb

VARINT, PACKED = 0, 2
"""Wire types of numbers and of packed doubles (protobuf encoding)."""
FIELDS = {1: "arrival_ns", 3: "counter", 4: "counts", 5: "device_ns"}
"""Numbers of the fields that are read, as `schemas/tacdata.proto` gives them."""


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
    arrays: dict[str, np.ndarray] = {}
    lengths = np.fromiter(map(len, data), np.int64, len(data))
    pending = np.ones(len(data), dtype=bool)
    # Messages of one length mostly share a layout, so that they can be decoded as columns.
    for length in np.unique(lengths).tolist():
        rows = np.flatnonzero(lengths == length)
        flat = np.frombuffer(b"".join([data[k] for k in rows.tolist()]), np.uint8).reshape(len(rows), -1)
        alike, columns = _columns(flat)
        for name, values in columns.items():
            if name not in arrays:
                arrays[name] = np.zeros((len(data), *values.shape[1:]), values.dtype)
            if arrays[name].shape[1:] == values.shape[1:]:
                arrays[name][rows[alike]] = values[alike]
            else:
                alike &= False
        pending[rows[alike]] = False
    return _with_rest(data, arrays, np.flatnonzero(pending))


def _columns(flat: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Decode messages of one length, shape (n, bytes), by the layout of the first.

    Returns:
        Which messages share that layout, shape (n,), bool; field name -> values, shape (n,) or (n, channels).
    """
    alike, columns = np.ones(len(flat), dtype=bool), {}
    first, place = flat[0], 0
    while place < len(first):
        number, wire = int(first[place]) >> 3, int(first[place]) & 7
        alike &= flat[:, place] == first[place]
        width = _varint_bytes(first, place + 1)
        values = _varints(flat[:, place + 1 : place + 1 + width], alike)
        place += 1 + width
        if wire == PACKED and number == 4 and values[0] % 8 == 0 and 0 < values[0] <= len(first) - place:
            alike &= values == values[0]
            values = np.ascontiguousarray(flat[:, place : place + int(values[0])]).view("<f8")
            place += values.shape[1] * 8
        elif wire != VARINT or width == 0:
            return np.zeros(len(flat), dtype=bool), {}
        if FIELDS.get(number) in columns:  # the field occurs twice
            return np.zeros(len(flat), dtype=bool), {}
        if number in FIELDS:
            columns[FIELDS[number]] = values
    if set(columns) != set(FIELDS.values()):  # protobuf omits a 0
        return np.zeros(len(flat), dtype=bool), {}
    return alike, columns


def _varint_bytes(message: np.ndarray, place: int) -> int:
    """Return the length of a varint [bytes]; 0 if it does not end within ten."""
    ends = np.flatnonzero(message[place : place + 10] < 0x80)
    return int(ends[0]) + 1 if len(ends) else 0


def _varints(octets: np.ndarray, alike: np.ndarray) -> np.ndarray:
    """Return varints of equal length, shape (n, bytes), as int64; clears ``alike`` where a length differs."""
    more = octets >= 0x80
    alike &= (more[:, :-1].all(axis=1)) & ~more[:, -1] if octets.shape[1] else False
    # Seven bits an octet, the lowest first; the eighth bit marks continuation (protobuf encoding).
    values = np.zeros(len(octets), np.uint64)
    for k in range(octets.shape[1]):
        values |= (octets[:, k] & np.uint8(0x7F)).astype(np.uint64) << np.uint64(7 * k)
    return values.view(np.int64)


def _with_rest(data: list[bytes], arrays: dict[str, np.ndarray], rows: np.ndarray) -> TaxelFrames:
    """Return all frames; messages of another layout are decoded one by one."""
    frames = [pb.Taxels.FromString(data[k]) for k in rows.tolist()]
    widths = {len(frame.counts) for frame in frames}
    if len(rows) < len(data):
        widths.add(arrays["counts"].shape[1])
    names = ("arrival_ns", "counter", "device_ns")
    numbers = {name: arrays.get(name, np.zeros(len(data), np.int64)) for name in names}
    for name, values in numbers.items():
        values[rows] = [getattr(frame, name) for frame in frames]
    width = next(iter(widths)) if len(widths) == 1 else 0
    counts = arrays.get("counts", np.zeros((len(data), 0)))
    if counts.shape[1] != width:
        counts = np.zeros((len(data), width))
    if frames and width:
        counts[rows] = [list(frame.counts) for frame in frames]
    return TaxelFrames(numbers["arrival_ns"], numbers["counter"], numbers["device_ns"], counts, tuple(sorted(widths)))
