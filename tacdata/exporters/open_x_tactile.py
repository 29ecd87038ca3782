"""Open-X-Tactile: the Zarr layout that FTP-1 learns from, one store a task.

By its public description (ftp1-policy, data_processing): Zarr version 2, time first in every array of ``data/``,
``meta/episode_ends``, poses as xyz and rotation vector, four arrays for each group of tactile areas. A hand is
described as a gripper: the middle of its fingertips, and how far they are open. The exact targets are in
``tacdata/``.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import Exporter, new_folder
from tacdata.replay.targets import FingertipTargets

AREAS = {"thumb": 0, "index": 1, "middle": 2, "ring": 3, "little": 4}
"""Functional area of a fingertip [1]: thumb and index as in the published examples, the others in their order.

Unknown kinds are counted on from 5.
"""
GRIPPER = 28
"""Slot of a gripper's opening among the joints of a hand [1]."""
SIDE = 224
"""Side of an image [px], as FTP-1's networks take it."""
ROWS = 32
"""Rows of a chunk."""
EXACT = ("time_ns", "position", "quaternion", "seen", "depth", "gap")
"""Fields of the targets that are kept as they are."""
OWN = "tacdata"
"""Group of the exact targets, which loaders of the layout pass over."""


class OpenXTactile(Exporter):
    """A folder with a Zarr store for each task: ``TASK.zarr``.

    - ``camera_main_rgb``: the first camera that stored images, 224 x 224, the last image before each row;
    - ``SIDE_wrist_pose`` [m, rad]: the middle of the hand's fingertips, turned as its first finger;
    - ``SIDE_hand_joints`` [m]: distance from the first fingertip to the middle of the others, slot 28;
    - ``SIDE_tactile_data_fingertips`` [counts]: tared readings as rows and columns of taxels, of type ``state``;
    - ``SIDE_tactile_data_predicteddepth`` [mm]: a network's estimate, where there is one;
    - ``timestamps``: numbers of frames, as in the published stores. Times in ns: ``tacdata/time_ns``.
    """

    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Write a new folder of stores."""
        if not episodes:
            raise UsageError("no demonstrations", "one or more", "track demonstrations first")
        tasks = {targets.task: [t for t in episodes if t.task == targets.task] for targets in episodes}
        for task, listed in tasks.items():
            # A store has one set of arrays for all of its episodes.
            if any((t.fingers, _layout(t)) != (listed[0].fingers, _layout(listed[0])) for t in listed):
                raise UsageError(
                    f"demonstrations of {task!r} with other fingers or boards", "the same in all", "export them apart"
                )
        new_folder(directory)
        remarks: list[str] = []
        for task, listed in tasks.items():
            name = re.sub(r"\W+", "_", task).strip("_") or "task"
            remarks += _store(directory / f"{name}.zarr", listed, self.recordings)
        # Several stores may lack the same; one remark is enough.
        return list(dict.fromkeys(remarks))

    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the exact targets of a folder."""
        stores = sorted(Path(directory).glob("*.zarr"))
        if not stores:
            raise UsageError(f"no store in {directory}", "a folder that tacdata export wrote", "check the path")
        return [targets for store in stores for targets in _targets(store)]


def _layout(targets: FingertipTargets) -> list[tuple[str, bool, bool]]:
    """Return which fingers have readings and predicted depth."""
    demonstration = targets.source
    tracks = [] if demonstration is None else [(name, demonstration.tracks[name]) for name in targets.fingers]
    return [(name, track.signals is not None, track.depth is not None) for name, track in tracks]


def _store(store: Path, listed: list[FingertipTargets], recordings: Path | None) -> list[str]:
    parts = [_columns(targets) for targets in listed]
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    ends = np.cumsum([len(targets.time_ns) for targets in listed])
    # A folder counts as a group of Zarr by this file.
    for group in (".", "data", "meta", OWN):
        documents.write_text(store / group / ".zgroup", json.dumps({"zarr_format": 2}))
    for key, values in columns.items():
        _array(store / "data" / key, values)
    _array(store / "meta" / "episode_ends", ends)
    for key in EXACT:
        _array(store / OWN / key, np.concatenate([getattr(targets, key) for targets in listed]))
    headers = [targets.header(columns) for targets in listed]
    for header in headers:
        documents.check(header, "fingertip_targets", str(store))
    taxels, valid = _channels(listed)
    for name, values in valid.items():
        _array(store / OWN / f"valid_{name}", values)
    documents.write_text(store / OWN / ".zattrs", json.dumps({"episodes": headers, "taxels": taxels}, indent=1))
    pictures = [_pictures(targets, recordings) for targets in listed]
    if not all(pictures):
        return [f"{store.name} has no RGB stream, as a recording stores no images: FTP-1's loader wants one"]
    frames = [frame for part in pictures for frame in part]
    _blocks(
        store / "data" / "camera_main_rgb",
        (len(frames), SIDE, SIDE, 3),
        np.dtype(np.uint8),
        lambda begin, end: np.stack([_picture(data) for data in frames[begin:end]]),
    )
    return []


def _channels(listed: list[FingertipTargets]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return unit, frame and places of each finger's channels, and whether each has a reading, (rows, taxels)."""
    first = listed[0].source
    if first is None:
        return {}, {}
    felt = [name for name in listed[0].fingers if first.tracks[name].signals is not None]
    places = {name: first.sensors[name].taxels.centers.tolist() for name in felt}
    taxels = {name: {"unit": "counts", "frame": f"skin of {name}", "place_mm": places[name]} for name in felt}
    parts = {name: [(t.source.tracks[name].signals, t.rows) for t in listed if t.source] for name in felt}
    return taxels, {
        name: np.concatenate([np.isfinite(values[rows]) for values, rows in some if values is not None])
        for name, some in parts.items()
    }


def _columns(targets: FingertipTargets) -> dict[str, np.ndarray]:
    count = len(targets.time_ns)
    columns = {"timestamps": np.arange(count), "sub_task_instruction": np.full(count, targets.task.ljust(100))}
    demonstration = targets.source
    hands = {name: demonstration.tracks[name].hand if demonstration else "" for name in targets.fingers}
    for side in ("left", "right"):
        # A hand that is not known counts as right, as a gripper does in the published stores.
        indices = [k for k, n in enumerate(targets.fingers) if (hands[n] if hands[n] == "left" else "right") == side]
        if not indices:
            continue
        place = targets.position[:, indices]
        turn = Rotation.from_quat(targets.quaternion[:, indices[0]]).as_rotvec()
        columns[f"{side}_wrist_pose"] = np.concatenate([place.mean(axis=1), turn], axis=1).astype(np.float32)
        if len(indices) > 1:
            # The thumb, or whichever finger is named first, opposes all others.
            opening = np.linalg.norm(place[:, 0] - place[:, 1:].mean(axis=1), axis=1)
            columns[f"{side}_hand_joints"] = opening[:, None].astype(np.float32)
            columns[f"{side}_hand_joints_idx"] = np.full((count, 1), GRIPPER, np.int32)
        columns |= _felt(targets, side, [targets.fingers[k] for k in indices])
    return columns


def _felt(targets: FingertipTargets, side: str, names: list[str]) -> dict[str, np.ndarray]:
    """Return the tactile groups of a hand: readings, and predicted depth if there is any."""
    demonstration, columns = targets.source, {}
    if demonstration is None:
        return {}
    for group, unit, of in (("fingertips", "counts", _readings), ("predicteddepth", "predicted mm", _depth)):
        # An array has one shape: fingers with other boards need a group of their own.
        shapes: dict[tuple[int, ...], dict[str, np.ndarray]] = {}
        for name in names:
            if (values := of(targets, name)) is not None:
                shapes.setdefault(values.shape[1:], {})[name] = values
        for number, members in enumerate(shapes.values()):
            key = group + (str(number) if len(shapes) > 1 else "")
            kinds = [demonstration.tracks[name].kind for name in members]
            area = [AREAS.get(kind, len(AREAS) + k) for k, kind in enumerate(kinds)]
            count, sensor = len(targets.time_ns), demonstration.sensors[next(iter(members))].name
            columns |= {
                f"{side}_tactile_data_{key}": np.stack(list(members.values()), axis=1),
                f"{side}_tactile_area_{key}": np.tile(np.array([area], np.int64), (count, 1)),
                f"{side}_tactile_sensor_{key}": np.full(count, f"{sensor} {unit}"),
                f"{side}_tactile_type_{key}": np.full(count, "state"),
            }
    return columns


def _readings(targets: FingertipTargets, name: str) -> np.ndarray | None:
    demonstration = targets.source
    if demonstration is None or (signals := demonstration.tracks[name].signals) is None:
        return None
    taxels = demonstration.sensors[name].taxels
    shape = (taxels.rows, taxels.columns) if taxels.rows * taxels.columns == signals.shape[1] else signals.shape[1:]
    # The layout knows no missing value; `valid_` arrays of the exact targets mark them.
    return np.nan_to_num(signals[targets.rows]).astype(np.float32).reshape(-1, *shape)


def _depth(targets: FingertipTargets, name: str) -> np.ndarray | None:
    demonstration = targets.source
    if demonstration is None or (depth := demonstration.tracks[name].depth) is None:
        return None
    return np.nan_to_num(depth[targets.rows]).astype(np.float32)


def _pictures(targets: FingertipTargets, recordings: Path | None) -> list[bytes]:
    """Return the last stored image before each row, as it was stored; [] if there are none."""
    from tacdata.demonstrations.recording.images import stored_images

    path = recordings / targets.recording if recordings else None
    times, images = stored_images(path) if path and path.is_file() else (np.array([]), [])
    if not images:
        return []
    # Rows before the first image take the first.
    return [images[k] for k in np.clip(np.searchsorted(times, targets.time_ns, "right") - 1, 0, None)]


def _picture(data: bytes) -> np.ndarray:
    import cv2

    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:  # damaged: black, rather than a row too few
        return np.zeros((SIDE, SIDE, 3), np.uint8)
    return cv2.cvtColor(cv2.resize(image, (SIDE, SIDE), interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2RGB)


def _array(folder: Path, values: np.ndarray) -> None:
    _blocks(folder, values.shape, values.dtype, lambda begin, end: values[begin:end])


def _blocks(folder: Path, shape: tuple[int, ...], dtype: np.dtype, rows: Callable[[int, int], np.ndarray]) -> None:
    """Write an array of Zarr version 2, given its rows from one number to before another."""
    chunks = (min(ROWS, max(shape[0], 1)), *shape[1:])
    # Its zlib needs no package beyond Python's own.
    described = {
        "zarr_format": 2,
        "shape": shape,
        "chunks": chunks,
        "dtype": dtype.str,
        "order": "C",
        "fill_value": None,
        "filters": None,
        "compressor": {"id": "zlib", "level": 1},
    }
    documents.write_text(folder / ".zarray", json.dumps(described))
    for number, begin in enumerate(range(0, shape[0], chunks[0])):
        # Every chunk has the full size, the last one too.
        block = np.zeros(chunks, dtype)
        part = rows(begin, min(begin + chunks[0], shape[0]))
        block[: len(part)] = part
        name = ".".join([str(number), *["0"] * (len(shape) - 1)])
        (folder / name).write_bytes(zlib.compress(block.tobytes(), 1))


def _targets(store: Path) -> Iterator[FingertipTargets]:
    try:
        headers = json.loads((store / OWN / ".zattrs").read_text())["episodes"]
        columns = {key: _values(store / OWN / key) for key in EXACT}
        ends = _values(store / "meta" / "episode_ends")
    except (OSError, ValueError, KeyError, TypeError, zlib.error) as error:
        fault = f"{store}: the exact targets are missing or damaged: {error}"
        raise FormatError(fault, "a store that tacdata export wrote", "export again") from None
    named = ("recording", "recording_hash", "task", "frame", "rate", "kind", "gains", "network", "provenance")
    for header, begin, end in zip(headers, [0, *ends[:-1]], ends, strict=True):
        documents.check(header, "fingertip_targets", str(store))
        rows: dict[str, Any] = {key: values[begin:end] for key, values in columns.items()}
        yield FingertipTargets(
            **{name: header[name] for name in named},
            **rows,
            fingers=tuple(header["fingers"]),
            remarks=tuple(header["remarks"]),
        )


def _values(folder: Path) -> np.ndarray:
    """Return an array that `_blocks` wrote."""
    described = json.loads((folder / ".zarray").read_text())
    chunks, shape = described["chunks"], described["shape"]
    end = ".0" * (len(shape) - 1)
    # Rounded up: the last chunk is filled with zeros.
    count = -(-shape[0] // chunks[0])
    blocks = [zlib.decompress((folder / f"{k}{end}").read_bytes()) for k in range(count)]
    return np.frombuffer(b"".join(blocks), described["dtype"]).reshape(-1, *shape[1:])[: shape[0]]
