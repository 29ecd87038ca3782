"""The maps of a label that are drawn: of a long one the deepest; the rest of its file is not read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.labels import Label, map_batches, read_label_columns
from tacdata.viewers.scene import thinning

BATCH = 2000
"""Maps in memory at a time [frames]."""

CONTACT = ("traction", "taxel_pressure")
"""Columns of contact pressure, which not every label has."""


@dataclass(frozen=True)
class ShownLabel:
    """Part of a `tacdata.labels.Label`."""

    time_ns: np.ndarray
    """Time of each frame [ns], shape (n,), int64."""
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (n, 3), float32."""
    error: np.ndarray
    """Root mean square of the estimated numerical error [mm], shape (n,), float32."""
    kept: np.ndarray
    """Rows whose maps are here [frames], shape (k,), ascending."""
    signed: np.ndarray
    """Their maps: undeformed minus deformed height of the outer face [mm], shape (k, pixels_x, pixels_y), float32."""
    traction: np.ndarray | None = None
    """Their contact force on the indenter by area [MPa], shape (k, 3, pixels_x, pixels_y), float16, if known."""

    taxel_pressure: np.ndarray | None = None
    """Their pressure of each protrusion on the board [MPa], shape (k, taxels, 10, 10), float16, if known."""

    @classmethod
    def of(cls, label: Label) -> ShownLabel:
        """Return all of a label's maps."""
        rows = np.arange(len(label.time_ns))
        return cls(label.time_ns, label.force, label.error, rows, label.signed, label.traction, label.taxel_pressure)

    @property
    def map_ns(self) -> np.ndarray:
        """Times of the maps [ns], shape (k,), int64."""
        return self.time_ns[self.kept]


def shown_label(path: Path, limit: int | None = None) -> ShownLabel:
    """Read the drawn parts of a label file.

    Args:
        path: The file.
        limit: Maps to keep, the deepest of each stretch (`thinning.strongest`); without it all.

    Raises:
        UsageError: As `tacdata.labels.read_label`.
        FormatError: As `tacdata.labels.read_label`.
    """
    small = read_label_columns(path, ("time_ns", "force", "error"))
    count = len(small["time_ns"])
    if limit is None or count <= limit:
        return ShownLabel(**small, kept=np.arange(count), **read_label_columns(path, ("signed", *CONTACT)))
    starts = thinning.stretches(count, limit)
    best, row, deepest_maps = np.full(limit, -np.inf), np.zeros(limit, int), {}
    begin = 0
    for maps in map_batches(path, "signed", BATCH):
        depth = maps.reshape(len(maps), -1).max(axis=1)
        owners = np.searchsorted(starts, begin + np.arange(len(maps)), side="right") - 1
        for stretch in range(owners[0], owners[-1] + 1):
            rows = np.flatnonzero(owners == stretch)
            deepest = rows[np.argmax(depth[rows])]
            if depth[deepest] > best[stretch]:
                best[stretch], row[stretch] = depth[deepest], begin + deepest
                deepest_maps[stretch] = maps[deepest].copy()
        begin += len(maps)
    signed = np.stack([deepest_maps[k] for k in range(limit)])
    # One after the other: each is as large as all maps of the label.
    contact = {name: values[row] for only in CONTACT for name, values in read_label_columns(path, (only,)).items()}
    return ShownLabel(**small, kept=row, signed=signed, **contact)
