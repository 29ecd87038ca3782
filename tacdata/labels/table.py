"""The label as a Parquet file: one row a frame, the header (`schemas/label.schema.json`) in its metadata."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.labels import columns
from tacdata.labels.label import Label
from tacdata.paths import StrPath
from tacdata.replacement import replacement

HEADER = b"tacdata.label"
REMEDY = "run `tacdata label` again: labels can always be made anew"


class LabelVersionError(FormatError):
    """A label was written by a release with another major version of the format; it is not damaged."""


def _column(values: np.ndarray) -> pa.Array:
    flat = _flat(np.ascontiguousarray(values).reshape(-1))
    return flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, int(np.prod(values.shape[1:])))


def _flat(values: np.ndarray) -> pa.Array:
    if values.dtype == bool:
        return pa.array(values)  # packed, eight in a byte
    # By its buffer, as `pa.array` would import pandas to ask whether the values are a series of it.
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(values)])


def write(path: StrPath, label: Label) -> None:
    """Write a label file so that a crash leaves the old file or the new one, never a half.

    Values are kept bit for bit in the types that `Label` documents.

    Raises:
        FormatError: If the arrays' shapes contradict each other or a value is not finite.
    """
    path = Path(path)
    columns.check(label, str(path))
    names = columns.present(label)
    header: dict[str, Any] = {
        "version": schemas.version("label"),
        "episode": label.episode,
        "frames": len(label.time_ns),
        "pixels_x": label.signed.shape[1],
        "pixels_y": label.signed.shape[2],
        "taxels": label.taxel_force.shape[1],
        "units": {name: columns.ALL[name].unit for name in names},
        "provenance": label.provenance,
    }
    documents.check(header, "label", str(path))
    arrays = {name: _column(np.asarray(getattr(label, name), dtype=columns.ALL[name].dtype)) for name in names}
    table = pa.Table.from_arrays([*arrays.values()], names=[*arrays]).replace_schema_metadata(
        {HEADER: json.dumps(header)}
    )
    with replacement(path) as stream:
        # Digits of maps hardly repeat: dictionaries of them took as long again and made files half as large again.
        pq.write_table(table, stream, compression="zstd", use_dictionary=False, write_page_checksum=True)


def read(path: StrPath) -> Label:
    """Read a label file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, no label file, or of another major format version.

    Example:
        >>> import tacdata as td
        >>> label = td.read_label("session/labels/episode-000000.parquet")
        >>> label.signed.shape  # frames and pixels
        (170, 35, 26)
        >>> round(float(label.signed.max()), 1)  # deepest pixel, mm
        0.8
    """
    path = Path(path)
    file = _open(path)
    header, arrays = _arrays(file, path, file.schema_arrow.names)
    return Label(episode=header["episode"], provenance=header["provenance"], **arrays)


def read_columns(path: StrPath, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return some columns of a label file, as `Label` documents them; the others are not read, nor checked.

    Args:
        path: The file.
        names: Columns; those that not every label has (`columns.OPTIONAL`) are left out where this one lacks them.

    Raises:
        UsageError: If it does not exist.
        FormatError: If these columns are damaged, it is no label file, or of another major format version.
    """
    path = Path(path)
    return _arrays(_open(path), path, names)[1]


def map_batches(path: StrPath, name: str, rows: int) -> Iterator[np.ndarray]:
    """Yield the maps of a label file, ``rows`` at most at a time, so that a long one needs little memory.

    Args:
        path: The file.
        name: A column of maps, such as ``signed``.
        rows: Frames a batch.

    Yields:
        Maps as `Label` documents them, shape (rows or fewer, pixels_x, pixels_y), all frames in order.

    Raises:
        UsageError: If it does not exist.
        FormatError: As `read_columns`.
    """
    path = Path(path)
    file = _open(path)
    header = _checked(file, path)
    pixels = header["pixels_x"], header["pixels_y"]
    try:
        for batch in file.iter_batches(rows, columns=[name], use_threads=False):
            yield _values(batch.column(0), name, columns.ALL[name].shape(len(batch), pixels, header["taxels"]))
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from None
    except (ValueError, TypeError) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None


def _arrays(file: pq.ParquetFile, path: Path, names: Sequence[str]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    header = _checked(file, path)
    names = [name for name in names if name not in columns.OPTIONAL or name in file.schema_arrow.names]
    try:
        table = file.read(columns=names)
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from None
    size = (header["frames"], (header["pixels_x"], header["pixels_y"]), header["taxels"])
    try:
        return header, {name: _values(table.column(name), name, columns.ALL[name].shape(*size)) for name in names}
    except (ValueError, TypeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None


def _checked(file: pq.ParquetFile, path: Path) -> dict[str, Any]:
    """Return the header of a file whose columns are those of a label."""
    header, present = _header(file.schema_arrow, path), set(file.schema_arrow.names)
    if not set(columns.REQUIRED) <= present <= set(columns.ALL) or file.metadata.num_rows != header["frames"]:
        raise FormatError(
            f"{path}: {file.metadata.num_rows} rows of {', '.join(file.schema_arrow.names)}",
            f"{header['frames']} rows of {', '.join(columns.REQUIRED)}; perhaps {', '.join(columns.OPTIONAL)}",
            REMEDY,
        )
    return header


def read_header(path: StrPath) -> dict[str, Any]:
    """Return a label file's header (`schemas/label.schema.json`) without reading its columns.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, no label file, or of another major format version.
    """
    path = Path(path)
    return _header(_open(path).schema_arrow, path)


def _open(path: Path) -> pq.ParquetFile:
    if not path.is_file():
        raise UsageError(f"no label file {path}", "a file that `tacdata label` wrote", "run `tacdata label`")
    try:
        return pq.ParquetFile(path, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> FormatError:
    reason = str(error).splitlines()[0]
    return FormatError(f"{path} is damaged or no Parquet file: {reason}", "a label file", REMEDY)


def _header(schema: pa.Schema, path: Path) -> dict[str, Any]:
    raw = (schema.metadata or {}).get(HEADER)
    if raw is None:
        raise FormatError(f"{path}: no key {HEADER.decode()} in its metadata", "a label file", "name a label file")
    try:
        header = json.loads(raw)
    except ValueError as error:
        raise FormatError(f"{path}: unreadable header: {error}", "a label file", "run `tacdata label` again") from None
    _check_version(header, path)
    documents.check(header, "label", str(path))
    return header


def _check_version(header: Any, path: Path) -> None:
    version, supported = str(dict(header).get("version", "")), schemas.version("label")
    if version.split(".")[0] != supported.split(".")[0]:
        raise LabelVersionError(
            f"{path}: label format version {version}",
            f"version {supported}",
            "run `tacdata label --redo`: labels can always be made anew; or use the tacdata release that wrote it",
        )


def _values(column: pa.ChunkedArray | pa.Array, name: str, shape: tuple[int, ...]) -> np.ndarray:
    if isinstance(column, pa.ChunkedArray):
        column = column.chunk(0) if column.num_chunks == 1 else column.combine_chunks()
    flat = column.flatten() if isinstance(column, pa.FixedSizeListArray) else column
    dtype = columns.ALL[name].dtype
    if flat.type != pa.from_numpy_dtype(dtype) or flat.null_count:
        raise ValueError(f"column {name} is {flat.type} with {flat.null_count} missing, not {dtype}")
    return np.from_dlpack(flat).reshape(shape)  # pyarrow's own way imports pandas for it
