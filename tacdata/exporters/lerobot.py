"""LeRobot v3.0: targets as actions; images, readings and predictions as observations."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from tacdata import documents
from tacdata.dataset.format import folder, tiff
from tacdata.dataset.format.features import INDEX_COLUMNS
from tacdata.dataset.format.whole_dataset import write_whole
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import Exporter, new_folder
from tacdata.replay.columns import AXES, TURNS
from tacdata.replay.targets import FingertipTargets

META = Path("meta/tacdata_targets.json")
"""Meaning of the targets, one entry per episode (`schemas/fingertip_targets.schema.json`)."""
ACTION, STATE = "action", "observation.state"
DEPTH, FELT, GAP = "tacdata.predicted_contact_depth", "tacdata.felt", "tacdata.gap"
TIME = "tacdata.time_ns"
TACTILE, VALID = "observation.tactile.", "tacdata.valid."
EXACT = "tacdata.exact"
"""Position, quaternion, seen [m] and depth [mm] of each finger, float64: `action` has no more than seven digits."""


class Lerobot(Exporter):
    """One LeRobot dataset of all demonstrations; opens in stock lerobot.

    Its features:

    - ``action``: fingertip targets, x y z [m] and qx qy qz qw per finger;
    - ``observation.state``: fingertips as seen, in the same form;
    - ``observation.tactile.FINGER``: readings [counts]; ``info`` has the place of each channel on the skin [mm];
    - ``tacdata.valid.FINGER``: whether each channel has a reading; 0 where it has none;
    - ``observation.predicted_depth.FINGER``: a network's estimate as a float32 depth image, metres in the file and
      millimetres in lerobot; the feature's ``info`` holds the checkpoint's hash;
    - ``tacdata.predicted_novelty.FINGER``: above 1 the readings are unlike all training readings.
    """

    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Write a new dataset."""
        rate = _same([targets.rate for targets in episodes], "rates")
        fingers = _same([targets.fingers for targets in episodes], "fingers")
        # Predictions of two networks in one column would not compare.
        _same([json.dumps(targets.network) for targets in episodes], "networks")
        columns = [_columns(targets) for targets in episodes]
        features = _features(episodes[0], columns[0])
        # LeRobot has one list of features for all episodes.
        if any(set(names) != set(columns[0]) for names in columns):
            raise UsageError("demonstrations with boards on other fingers", "the same in all", "export them separately")
        new_folder(directory)
        entries = [targets.header([*features, *INDEX_COLUMNS]) for targets in episodes]
        # All descriptions are checked before anything is written.
        for entry in entries:
            documents.check(entry, "fingertip_targets", str(directory / META))
        documents.write_text(directory / META, json.dumps(entries, indent=1))
        packed = [(record, targets.task) for targets, record in zip(episodes, columns, strict=True)]
        info = write_whole(directory, features, packed, rate, "fingertips " + " ".join(fingers))
        note = f"fps is {info['fps']} where the grid has {rate:g} Hz: LeRobot wants whole numbers"
        return [] if info["fps"] == rate else [note]

    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the targets of a dataset, to the last bit."""
        info = folder.read_info(Path(directory))
        try:
            entries = json.loads((Path(directory) / META).read_text())
        except (OSError, ValueError) as error:
            fault = f"{directory}: {META} is missing or damaged: {error}"
            raise FormatError(fault, "a folder that tacdata export wrote", "export again") from None
        rows = folder.read_rows(Path(directory), info)
        if len(entries) != len(rows):
            fault = f"{directory}: {len(rows)} episodes, {META} describes {len(entries)}"
            raise FormatError(fault, "one entry per episode", "export again")
        return [_read(Path(directory), row, entry) for row, entry in zip(rows, entries, strict=True)]


def _same(values: Sequence[Any], what: str) -> Any:
    if not values:
        raise UsageError("no demonstrations", "one or more", "track demonstrations first")
    if any(value != values[0] for value in values):
        raise UsageError(f"demonstrations of different {what}", "one dataset, one of each", "export them separately")
    return values[0]


def _columns(targets: FingertipTargets) -> dict[str, np.ndarray]:
    count, demonstration = len(targets.time_ns), targets.source
    columns = {
        ACTION: np.concatenate([targets.position, targets.quaternion], -1).reshape(count, -1).astype(np.float32),
        STATE: np.concatenate([targets.seen, targets.quaternion], -1).reshape(count, -1).astype(np.float32),
        # LeRobot's statistics allow no NaN: 0 where nothing was felt; the column FELT marks it.
        DEPTH: np.nan_to_num(targets.depth).astype(np.float32),
        FELT: np.isfinite(targets.depth),
        GAP: targets.gap,
        TIME: targets.time_ns,
        EXACT: np.concatenate(
            [targets.position, targets.quaternion, targets.seen, np.nan_to_num(targets.depth)[..., None]], -1
        ).reshape(count, -1),
    }
    if len(targets.fingers) == 1:  # LeRobot stores a vector of length one as a number
        columns = {key: values[:, 0] if values.shape[1:] == (1,) else values for key, values in columns.items()}
    for name, track in (
        () if demonstration is None else ((name, demonstration.tracks[name]) for name in targets.fingers)
    ):
        if track.signals is not None:
            columns[f"{TACTILE}{name}"] = np.nan_to_num(track.signals[targets.rows])
            columns[f"{VALID}{name}"] = np.isfinite(track.signals[targets.rows])
        if track.depth is not None:
            # LeRobot's depth images are in metres.
            maps = np.nan_to_num(track.depth[targets.rows]).astype(np.float32)
            columns[f"observation.predicted_depth.{name}"] = maps / tiff.MM_PER_METRE
        if track.novelty is not None:
            columns[f"tacdata.predicted_novelty.{name}"] = np.nan_to_num(track.novelty[targets.rows]).astype(np.float32)
    return columns


def _features(targets: FingertipTargets, columns: dict[str, np.ndarray]) -> dict[str, dict[str, Any]]:
    pose = [f"{name}.{part}" for name in targets.fingers for part in (*AXES, *TURNS)]
    features: dict[str, dict[str, Any]] = {}
    for key, values in columns.items():
        # LeRobot states a number as a vector of length one.
        shape, names = list(values.shape[1:]) or [1], None
        info: dict[str, Any] = {}
        dtype = "bool" if values.dtype == bool else str(values.dtype)
        if key in (ACTION, STATE):
            names, info = pose, {"unit": "m, 1", "frame": targets.frame}
        elif key in (DEPTH, FELT, GAP):
            names, info = list(targets.fingers), {"unit": "mm" if key == DEPTH else "1"}
        elif values.ndim == 3:
            dtype, shape, names = "image", [*shape, 1], ["height", "width", "channels"]
            info = {"is_depth_map": True, "depth_unit": "m", "unit": "m"}
        elif key == EXACT:
            parts = (*AXES, *TURNS, *(f"seen_{axis}" for axis in AXES), "depth")
            names, info = [f"{n}.{part}" for n in targets.fingers for part in parts], {"unit": "m, 1, m, mm"}
        elif key.startswith(TACTILE) and targets.source:
            name = key.removeprefix(TACTILE)
            places = targets.source.sensors[name].taxels.centers
            info = {"unit": "counts", "frame": f"skin of {name}", "place_mm": places.tolist()}
        elif key != TIME:
            info = {"unit": "1"}
        if "predicted" in key:
            info |= {"prediction": True, "checkpoint": (targets.network or {}).get("hash", "")}  # ty: ignore[unsupported-operator]
        features[key] = {"dtype": dtype, "shape": shape, "names": names, "info": info}
    return features


def _read(directory: Path, row: folder.EpisodeRow, header: dict[str, Any]) -> FingertipTargets:
    documents.check(header, "fingertip_targets", str(directory / META))
    keys = [EXACT, FELT, GAP, TIME]
    table = folder.read_parquet(directory / folder.data_path(row.data_file), keys)
    fingers, count = tuple(header["fingers"]), table.num_rows

    def column(key: str, *shape: int) -> np.ndarray:
        values = table[key].combine_chunks()
        # Vectors are stored as lists; a hand of one finger has plain numbers.
        flat = values.flatten() if pa.types.is_nested(values.type) else values
        return flat.to_numpy(zero_copy_only=False).reshape(count, len(fingers), *shape)

    exact = column(EXACT, 11)
    # The table has 0 where nothing was felt, as statistics of LeRobot allow no NaN.
    depth = np.where(column(FELT), exact[..., 10], np.nan)
    named = ("recording", "recording_hash", "task", "frame", "rate", "kind", "gains", "network", "provenance")
    return FingertipTargets(
        **{name: header[name] for name in named},
        fingers=fingers,
        time_ns=table[TIME].to_numpy(),
        position=exact[..., :3],
        quaternion=exact[..., 3:7],
        seen=exact[..., 7:10],
        depth=depth,
        gap=column(GAP),
        remarks=tuple(header["remarks"]),
    )
