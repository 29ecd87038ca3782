"""Names, shapes and units of a dataset's columns, in LeRobot's terms."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from tacdata.errors import UsageError
from tacdata.labels import columns
from tacdata.sensor import Sensor

STATE = "observation.state"
"""Tared readings: raw counts minus their mean in the episode's rest phase [counts], shape (taxels,)."""
RAW = "observation.tactile_raw"
"""Raw readings [counts], shape (taxels,), float32."""
DEPTH = "observation.depth"
"""The label: the depth map clipped at 0, shape (pixels_x, pixels_y).

Stored as float32 TIFF in metres, which LeRobot takes for a depth image and its viewers show; `read_dataset`,
`WindowDataset` and LeRobot itself give millimetres. The signed map stays in the label file."""
TIP = "tacdata.tip"
"""Nominal x, y and depth of the indenter's lowest point [mm], shape (3,), float32."""
FORCE = "tacdata.force"
"""Simulated force of the skin on the indenter [N], shape (3,), float32."""
TAXEL_FORCE = "tacdata.taxel_force"
"""Simulated normal force of each protrusion [N], shape (taxels,), float32."""
LABEL_ERROR = "tacdata.label_error"
"""Estimated numerical error of the map, root mean square [mm], float32."""
TIME = "tacdata.time_ns"
"""Estimated sample time on the host's clock [ns], int64. LeRobot's `timestamp` is frame_index / fps."""
PHASE = "tacdata.phase"
"""Index into `tacdata.recording.episode.PHASES`, -1 outside every phase, int64."""
VALID = "tacdata.valid"
"""False where frames were lost just before, or outside the times of the commanded path."""
SENSOR = "tacdata.sensor"
"""First 60 bits of the sensor's content hash, int64: survives every edit, so a wrong sensor is noticed."""
RECORD = "tacdata.record"
"""First 60 bits of the record's hash, int64: leads to recording, label and press after every edit."""

INDEX_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""LeRobot's own columns."""

OWN = {
    STATE: ("float32", "counts"),
    RAW: ("float32", "counts"),
    DEPTH: ("image", "mm"),
    TIP: ("float32", "mm"),
    FORCE: ("float32", "N"),
    TAXEL_FORCE: ("float32", "N"),
    LABEL_ERROR: ("float32", "mm"),
    TIME: ("int64", "ns"),
    PHASE: ("int64", "1"),
    VALID: ("bool", "1"),
    SENSOR: ("int64", "1"),
    RECORD: ("int64", "1"),
}
"""LeRobot dtype of every column that `DatasetWriter` is given, and its unit as `read_dataset` gives it."""
DTYPES = {key: dtype for key, (dtype, _) in OWN.items()}
UNITS = {key: unit for key, (_, unit) in OWN.items()} | {"timestamp": "s"}

EXTRA = {f"tacdata.{name}": name for name in ("error_map", *columns.OPTIONAL)}
"""Columns that a dataset has only where they were asked for -> the label's column that they hold, as float32.

Maps, such as the error of each pixel, are stored flat, shape (pixels_x * pixels_y,), x slowest: LeRobot would
take another depth image for a camera."""


def short_hash(digest: str) -> int:
    """Return the first 60 bits of a hex digest, which fit an int64 column."""
    return int(digest[:15], 16)


def unit(key: str) -> str:
    """Return the unit of a column as `read_dataset` gives it; "1" of one that is not ours."""
    return columns.ALL[EXTRA[key]].unit if key in EXTRA else UNITS.get(key, "1")


def asked_for(names: Iterable[str]) -> tuple[str, ...]:
    """Return the columns for names that a person gave: those of the label's columns.

    Raises:
        UsageError: If a label has no such optional column.
    """
    keys = {name: key for key, name in EXTRA.items()}
    for name in names:
        if name not in keys:
            raise UsageError(f"no column {name!r} to carry along", ", ".join(keys), "name one of them")
    return tuple(dict.fromkeys(keys[name] for name in names))


def extra_of(described: Iterable[str]) -> tuple[str, ...]:
    """Return those of some columns that were asked for."""
    return tuple(key for key in described if key in EXTRA)


def shapes(sensor: Sensor, extra: Iterable[str] = ()) -> dict[str, tuple[int, ...]]:
    """Return the shape of one frame of every own column and of some of `EXTRA`; scalars are ``()``."""
    taxels = (sensor.taxels.count,)
    vectors = {STATE: taxels, RAW: taxels, DEPTH: sensor.map.shape, TIP: (3,), FORCE: (3,), TAXEL_FORCE: taxels}
    named_shapes = {key: columns.ALL[EXTRA[key]].shape(1, sensor.map.shape, sensor.taxels.count)[1:] for key in extra}
    flat = {key: (int(np.prod(shape)),) if shape else () for key, shape in named_shapes.items()}
    return {key: vectors.get(key, ()) for key in DTYPES} | flat


def _names(key: str, sensor: Sensor) -> list[str] | None:
    width = sensor.taxels.columns
    taxels = [f"taxel_{k % width}_{k // width}" for k in range(sensor.taxels.count)]
    if key in EXTRA:
        return taxels if columns.ALL[EXTRA[key]].kind == "taxels" else None
    axes = {DEPTH: ["height", "width", "channels"], TIP: ["x", "y", "depth"], FORCE: ["x", "y", "z"]}
    return taxels if key in (STATE, RAW, TAXEL_FORCE) else axes.get(key)


def lerobot_features(sensor: Sensor, extra: Iterable[str] = ()) -> dict[str, dict[str, Any]]:
    """Return the ``features`` entry of info.json. Units stand under ``info``, which LeRobot's edits keep."""
    features: dict[str, dict[str, Any]] = {}
    for key, shape in shapes(sensor, extra).items():
        info: dict[str, Any] = {"unit": unit(key)}
        if key == DEPTH:
            shape, info = (*shape, 1), {"is_depth_map": True, "depth_unit": "m", "unit": "m"}
        dtype, names = DTYPES.get(key, "float32"), _names(key, sensor)
        features[key] = {"dtype": dtype, "shape": list(shape or (1,)), "names": names, "info": info}
    for key, dtype in INDEX_COLUMNS.items():
        features[key] = {"dtype": dtype, "shape": [1], "names": None}
    return features


def cast(key: str, values: np.ndarray) -> np.ndarray:
    """Return ``values`` in the column's own type (the depth map as float32)."""
    dtype = DTYPES.get(key, "float32")
    return np.ascontiguousarray(values, dtype="float32" if dtype == "image" else dtype)
