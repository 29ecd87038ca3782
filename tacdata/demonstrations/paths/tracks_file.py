"""A processed demonstration as a file: Parquet, one row per grid time (`schemas/finger_tracks.schema.json`)."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents, schemas
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.replacement import replacement
from tacdata.sensor import Sensor

HEADER = b"tacdata.finger_tracks"
ENDING = ".tracks.parquet"
UNITS = {
    "position": "m",
    "quaternion": "1",
    "covariance": "rad^2, rad m, m^2",
    "gap": "1",
    "signals": "counts",
    "predicted_depth": "mm",
    "novelty": "1",
}
"""Column of a finger -> unit; the columns are called FINGER.COLUMN, and time_ns [ns]."""
REMEDY = "run `tacdata track` again: the recording holds everything"


def path_of(recording: Path) -> Path:
    """Return the path of a recording's tracks, in the recording's own folder."""
    return recording.with_name(recording.name.removesuffix(".mcap") + ENDING)


def write_tracks(path: Path, demonstration: Demonstration) -> None:
    """Write a processed demonstration; a crash leaves the old file or the new one.

    Raises:
        FormatError: If it contradicts the schema.
        DeviceError: If the disk refuses it.
    """
    columns: dict[str, Any] = {"time_ns": pa.array(demonstration.time_ns)}
    for name, track in demonstration.tracks.items():
        for column, values in _columns(track).items():
            flat = values.reshape(len(values), -1)
            columns[f"{name}.{column}"] = (
                pa.array(values)
                if values.ndim == 1
                else pa.FixedSizeListArray.from_arrays(pa.array(flat.reshape(-1)), flat.shape[1])
            )
    header = {
        "version": schemas.version("finger_tracks"),
        **{k: getattr(demonstration, k) for k in ("recording", "recording_hash", "task", "frame", "rate", "smoothing")},
        "frames": len(demonstration.time_ns),
        "fingers": {
            name: _described(track, demonstration.sensors.get(name)) for name, track in demonstration.tracks.items()
        },
        "units": {"time_ns": "ns", **UNITS},
        "columns": list(columns),
        "network": demonstration.network,
        "remarks": list(demonstration.remarks),
        "provenance": demonstration.provenance,
    }
    documents.check(header, "finger_tracks", str(path))
    table = pa.table(columns).replace_schema_metadata({HEADER: json.dumps(header)})
    try:
        with replacement(path) as stream:
            pq.write_table(table, stream, compression="zstd", write_page_checksum=True)
    except OSError as error:
        fault = f"writing {path} failed: {error}"
        raise DeviceError(fault, "a disk with room", "make room, then track again") from error


def read_tracks(path: StrPath) -> Demonstration:
    """Read a processed demonstration.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or of another kind.
    """
    path = Path(path)
    folder = path.with_name(path.name.removesuffix(ENDING))
    if not path.is_file() and folder.is_dir():
        names = ", ".join(sorted(candidate.name for candidate in folder.glob(f"*{ENDING}"))) or "none yet"
        raise UsageError(f"the folder {folder}", f"one of its tracks ({names})", "name one; `tacdata track` makes them")
    if not path.is_file():
        raise UsageError(f"no file {path}", f"a file that ends in {ENDING}", "run `tacdata track` first")
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        header = json.loads((table.schema.metadata or {})[HEADER])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(f"{path} holds no tracks: {reason}", "a file that `tacdata track` wrote", REMEDY) from None
    documents.check(header, "finger_tracks", str(path))
    try:
        sensors = {
            name: Sensor.from_document(entry["sensor"], f"{path}: {name}")
            for name, entry in header["fingers"].items()
            if entry.get("sensor")
        }
        tracks = {n: _track(n, e, table, sensors.get(n)) for n, e in header["fingers"].items()}
        time_ns = table.column("time_ns").to_numpy()
    except (KeyError, ValueError, AttributeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None
    named = {f.name: header[f.name] for f in fields(Demonstration) if f.name in header and f.name != "remarks"}
    return Demonstration(**named, time_ns=time_ns, tracks=tracks, sensors=sensors, remarks=tuple(header["remarks"]))


def _columns(track: FingerTrack) -> dict[str, np.ndarray]:
    named = {"position": track.position, "quaternion": track.quaternion, "covariance": track.covariance}
    if track.signals is not None:
        named["signals"] = track.signals
    if track.depth is not None:
        named["predicted_depth"] = track.depth
    if track.novelty is not None:
        named["novelty"] = track.novelty
    return {**named, "gap": track.gap}


def _described(track: FingerTrack, sensor: Sensor | None) -> dict[str, Any]:
    entry = {"hand": track.hand, "kind": track.kind, "sightings": track.sightings, "outliers": track.outliers}
    return {**entry, "in_gaps": float(track.gap.mean()), "sensor": sensor.document if sensor else None}


def _track(name: str, entry: dict[str, Any], table: pa.Table, sensor: Sensor | None) -> FingerTrack:
    rows = table.num_rows

    def column(which: str, *shape: int) -> np.ndarray | None:
        if f"{name}.{which}" not in table.column_names:
            return None
        values = table.column(f"{name}.{which}").combine_chunks()
        return (values.flatten() if shape else values).to_numpy(zero_copy_only=False).reshape(rows, *shape)

    maps = sensor.map.shape if sensor else ()
    arrays = column("position", 3), column("quaternion", 4), column("covariance", 6, 6)
    # A missing one ends in a ValueError, which the reader turns into a message about the file.
    position, quaternion, covariance = (values for values in arrays if values is not None)
    return FingerTrack(
        name,
        entry["hand"],
        entry["kind"],
        position,
        quaternion,
        covariance,
        table.column(f"{name}.gap").to_numpy(),
        entry["sightings"],
        entry["outliers"],
        column("signals", -1),
        column("predicted_depth", *maps) if sensor else None,
        column("novelty"),
    )
