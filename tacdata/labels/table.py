"""The label as a Parquet file: one row a frame, the header (`schemas/label.schema.json`) in its metadata."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import schemas
from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.labels import columns
from tacdata.labels.label import Label
from tacdata.replacement import replacement

HEADER = b"tacdata.label"
REMEDY = "run `tacdata label` again: labels can always be made anew"


class VersionError(FormatError):
    """A label was written by a release with another major version of the format; it is not damaged."""


def _column(values: np.ndarray) -> pa.Array:
    flat = pa.array(np.ascontiguousarray(values).reshape(-1))
    return (
        flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, int(np.prod(values.shape[1:])))
    )


def write(path: Path, label: Label) -> None:
    """Write a label file so that a crash leaves the old file or the new one, never a half.

    Values are kept bit for bit in the types that `Label` documents.

    Raises:
        FormatError: If the arrays' shapes contradict each other or a value is not finite.
    """
    columns.check(label, str(path))
    names = columns.present(label)
    header: dict[str, Any] = {
        "version": schemas.version("label"),
        "episode": label.episode,
        "frames": len(label.time_ns),
        "pixels_x": label.signed.shape[1],
        "pixels_y": label.signed.shape[2],
        "taxels": label.taxel_force.shape[1],
        "units": {name: columns.UNITS[name] for name in names},
        "provenance": label.provenance,
    }
    documents.check(header, "label", str(path))
    arrays = {name: _column(np.asarray(getattr(label, name), dtype=columns.DTYPES[name])) for name in names}
    table = pa.table(arrays).replace_schema_metadata({HEADER: json.dumps(header)})
    with replacement(path) as stream:
        pq.write_table(table, stream, compression="zstd", write_page_checksum=True)


def read(path: Path) -> Label:
    """Read a label file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, no label file, or of another major format version.
    """
    file = _open(path)
    try:
        table = file.read()
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from None
    header = _header(table.schema, path)
    names = set(table.column_names)
    if not set(columns.REQUIRED) <= names <= set(columns.ALL) or table.num_rows != header["frames"]:
        raise FormatError(
            f"{path}: {table.num_rows} rows of {', '.join(table.column_names)}",
            f"{header['frames']} rows of {', '.join(columns.REQUIRED)}; perhaps {', '.join(columns.OPTIONAL)}",
            REMEDY,
        )
    size = (header["frames"], (header["pixels_x"], header["pixels_y"]), header["taxels"])
    try:
        arrays = {name: _values(table, name, columns.shape(name, *size)) for name in table.column_names}
    except (ValueError, TypeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None
    return Label(episode=header["episode"], provenance=header["provenance"], **arrays)


def read_header(path: Path) -> dict[str, Any]:
    """Return a label file's header (`schemas/label.schema.json`) without reading its columns.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, no label file, or of another major format version.
    """
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
        raise FormatError(
            f"{path}: no key {HEADER.decode()} in its metadata", "a label file", "name a label file"
        )
    try:
        header = json.loads(raw)
    except ValueError as error:
        raise FormatError(
            f"{path}: unreadable header: {error}", "a label file", "run `tacdata label` again"
        ) from None
    _check_version(header, path)
    documents.check(header, "label", str(path))
    return header


def _check_version(header: Any, path: Path) -> None:
    found, known = str(dict(header).get("version", "")), schemas.version("label")
    if found.split(".")[0] != known.split(".")[0]:
        raise VersionError(
            f"{path}: label format version {found}",
            f"version {known}",
            "run `tacdata label --redo`: labels can always be made anew; or use the tacdata release that wrote it",
        )


def _values(table: pa.Table, name: str, shape: tuple[int, ...]) -> np.ndarray:
    column = table.column(name).combine_chunks()
    flat = column.flatten() if isinstance(column, pa.FixedSizeListArray) else column
    values = flat.to_numpy(zero_copy_only=False)
    if values.dtype != columns.DTYPES[name]:
        raise ValueError(f"column {name} is {values.dtype}, not {columns.DTYPES[name]}")
    return values.reshape(shape)
