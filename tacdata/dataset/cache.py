"""A dataset's columns as memory maps: one .npy file a column, filed under the content hash of the data files.

They lie in ``$TACDATA_CACHE`` (else ``$XDG_CACHE_HOME/tacdata``, else ``~/.cache/tacdata``), never inside the
dataset, and may be deleted at any time.
"""

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.lib.format import open_memmap

from tacdata import documents, provenance
from tacdata.dataset.format import folder, tiff
from tacdata.errors import FormatError

LAYOUT = 1
"""Raised when the files change their meaning, so that old ones are rebuilt."""


def cache_root() -> Path:
    """Return the folder of all caches."""
    setting = os.environ.get("TACDATA_CACHE")
    if setting:
        return Path(setting).expanduser() / "datasets"
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(home).expanduser() / "tacdata" / "datasets"


def data_files(root: Path, rows: list[folder.EpisodeRow]) -> list[Path]:
    """Return the data files that hold counted episodes, in order.

    Raises:
        FormatError: If one is missing.
    """
    paths = [root / folder.data_path(number) for number in sorted({row.data_file for row in rows})]
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FormatError(
            f"{missing[0]} is missing" + (f" and {len(missing) - 1} more data files" if len(missing) > 1 else ""),
            f"all {len(paths)} data files that meta/episodes names",
            "copy the dataset again, or pack the session again",
        )
    return paths


def dataset_hash(root: Path, info: dict[str, Any], paths: list[Path], place: Path) -> str:
    """Return the identity of a dataset's content: SHA-256 over its columns' names and its data files (hex).

    Hashes of files whose size and time of change stay the same are remembered in ``place``.
    """
    memory = place / "hashes.json"
    try:
        entries = json.loads(memory.read_text())
    except (OSError, ValueError):
        entries = {}
    digests, fresh = {}, {}
    for path in paths:
        name, state = path.relative_to(root).as_posix(), path.stat()
        # The inode, too: a file may be replaced by one of its size within a tick of the clock.
        mark = f"{state.st_size}-{state.st_mtime_ns}-{state.st_ino}"
        entry = entries.get(name, [])
        fresh[name] = entry if entry[:1] == [mark] else [mark, provenance.file_hash(path)]
        digests[name] = fresh[name][1]
    if fresh != entries:
        documents.write_text(memory, json.dumps(fresh))
    content = {"features": info["features"], "fps": info["fps"], "frames": info["total_frames"], "files": digests}
    return provenance.content_hash(content)


def place_of(root: Path, cache: Path | None) -> Path:
    """Return the cache folder of one dataset folder."""
    return (cache or cache_root()) / provenance.content_hash(str(root.resolve()))[:16]


def open_columns(
    root: Path, info: dict[str, Any], paths: list[Path], place: Path, digest: str
) -> dict[str, np.ndarray]:
    """Return every column as a read-only memory map, making the files first if they are missing.

    Args:
        root: The dataset.
        info: Content of its info.json.
        paths: Its data files, in order.
        place: The dataset's cache folder.
        digest: Identity of the content.

    Raises:
        FormatError: If a data file is damaged or does not fit info.json.
    """
    target = place / f"{digest[:32]}-{LAYOUT}"
    if not target.is_dir():
        place.mkdir(parents=True, exist_ok=True)
        # In the same folder, as a rename to another file system is not atomic.
        temporary = Path(tempfile.mkdtemp(dir=place, prefix=".making-"))
        try:
            _fill(root, info, paths, temporary)
            os.replace(temporary, target)
        except OSError:
            # Another process may have finished the same folder first.
            if not target.is_dir():
                raise
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        for sibling in place.iterdir():
            # Maps of an earlier content of this dataset; who has them open keeps them.
            if sibling.is_dir() and sibling != target and not sibling.name.startswith("."):
                shutil.rmtree(sibling, ignore_errors=True)
    return {key: np.load(target / f"{key}.npy", mmap_mode="r") for key in info["features"]}


def _shape(feature: dict[str, Any]) -> tuple[int, ...]:
    shape = tuple(feature["shape"])
    return shape[:-1] if feature["dtype"] == "image" else shape if shape != (1,) else ()


def _fill(root: Path, info: dict[str, Any], paths: list[Path], target: Path) -> None:
    total, at = info["total_frames"], 0
    described = {key: f for key, f in info["features"].items() if f["dtype"] not in ("string", "video", "language")}
    maps = {}
    for key, feature in described.items():
        dtype = "float32" if feature["dtype"] == "image" else feature["dtype"]
        maps[key] = open_memmap(target / f"{key}.npy", mode="w+", dtype=dtype, shape=(total, *_shape(feature)))
    for path in paths:
        table = folder.read_parquet(path, list(described))
        index = table["index"].to_numpy()
        # An append that was broken off leaves frames that info.json does not count.
        counted = min(len(index), total - at)
        if not np.array_equal(index[:counted], np.arange(at, at + counted)):
            raise FormatError(
                f"{path}: its frames are not {at} to {at + counted - 1}",
                "data files that follow each other, as listed in meta/episodes",
                "put the original files back, or pack the session again",
            )
        for key, feature in described.items():
            try:
                maps[key][at : at + counted] = column_values(table[key], feature)[:counted]
            except (ValueError, TypeError, pa.ArrowException) as error:
                raise FormatError(
                    f"{path}: {key}: {error}", f"{feature['dtype']} {feature['shape']}", "pack the session again"
                ) from None
        at += counted
    if at != total:
        raise FormatError(
            f"{root}: the data files hold {at} frames", f"{total} as {folder.INFO} counts", "pack the session again"
        )
    # A full disk shows here, before the folder gets its name.
    for values in maps.values():
        values.flush()


def column_values(column: pa.ChunkedArray, feature: dict[str, Any]) -> np.ndarray:
    """Return a column of a data file as an array, frames first; depth maps in millimetres.

    Raises:
        ValueError: If it does not fit the feature.
    """
    shape = _shape(feature)
    if feature["dtype"] == "image":
        parts = [tiff.decode(chunk, (shape[0], shape[1])) for chunk in column.chunks]
        metres = np.concatenate(parts) if parts else np.empty((0, *shape), np.float32)
        scale = {"m": tiff.MM_PER_METRE, "mm": np.float32(1.0)}[(feature.get("info") or {}).get("depth_unit", "m")]
        return metres * scale
    if column.null_count:
        raise ValueError(f"{column.null_count} values are missing")
    array = column.combine_chunks()
    array = array.chunk(0) if isinstance(array, pa.ChunkedArray) else array
    flat = array.flatten() if shape else array
    values = flat.to_numpy(zero_copy_only=False)
    if values.dtype != np.dtype(feature["dtype"]):
        raise ValueError(f"it is {values.dtype}")
    return values.reshape(len(column), *shape)
