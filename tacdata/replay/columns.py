"""Targets as named columns for files, and back: the only place that knows the column names."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.replay.targets import FingertipTargets

AXES, TURNS = ("x", "y", "z"), ("qx", "qy", "qz", "qw")


def to_columns(targets: FingertipTargets) -> dict[str, np.ndarray]:
    """Return the columns of targets: time_ns, and for each finger FINGER.COLUMN_UNIT, shape (n,) each."""
    columns: dict[str, np.ndarray] = {"time_ns": targets.time_ns}
    for k, name in enumerate(targets.fingers):
        columns |= {f"{name}.{axis}_m": targets.position[:, k, n] for n, axis in enumerate(AXES)}
        columns |= {f"{name}.{part}": targets.quaternion[:, k, n] for n, part in enumerate(TURNS)}
        columns |= {f"{name}.seen_{axis}_m": targets.seen[:, k, n] for n, axis in enumerate(AXES)}
        columns[f"{name}.predicted_depth_mm"] = targets.depth[:, k]
        columns[f"{name}.gap"] = targets.gap[:, k].astype(np.int64)
    return columns


def from_columns(header: dict[str, Any], columns: dict[str, np.ndarray], origin: str) -> FingertipTargets:
    """Return the targets that a file's header (`schemas/fingertip_targets.schema.json`) and columns hold.

    Raises:
        FormatError: If the header breaks its schema, or columns are missing, of another length or not finite.
    """
    documents.check(header, "fingertip_targets", origin)
    missing = [name for name in header["columns"] if name not in columns]
    lengths = {len(columns[name]) for name in header["columns"] if name in columns}
    if missing or lengths != {header["frames"]}:
        raise FormatError(
            f"{origin}: " + (f"no column {missing[0]}" if missing else f"columns of {sorted(lengths)} rows"),
            f"{len(header['columns'])} columns of {header['frames']} rows, as its header says",
            "export again",
        )

    def stacked(*endings: str) -> np.ndarray:
        parts = [[columns[f"{name}.{ending}"] for ending in endings] for name in header["fingers"]]
        return np.moveaxis(np.array(parts, float), -1, 0)

    position, quaternion = stacked(*(f"{a}_m" for a in AXES)), stacked(*TURNS)
    if not np.isfinite(position).all() or not np.isfinite(quaternion).all():
        raise FormatError(f"{origin}: a pose that is no number", "finite poses", "export again")
    named = ("recording", "recording_hash", "task", "frame", "rate", "kind", "gains", "network", "provenance")
    return FingertipTargets(
        **{name: header[name] for name in named},
        fingers=tuple(header["fingers"]),
        time_ns=np.asarray(columns["time_ns"], np.int64),
        position=position,
        quaternion=quaternion,
        seen=stacked(*(f"seen_{a}_m" for a in AXES)),
        depth=stacked("predicted_depth_mm")[..., 0],
        gap=stacked("gap")[..., 0] > 0,
        remarks=tuple(header["remarks"]),
    )
