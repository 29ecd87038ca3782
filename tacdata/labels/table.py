"""The label as a Parquet file: one row a frame, the header (`schemas/label.schema.json`) in its metadata."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import schemas
from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.labels.label import Label

HEADER = b"tacdata.label"
REMEDY = "run `tacdata label` again: labels can always be made anew"
COLUMNS = {
    "time_ns": ("ns", "int64", 1),
    "tip": ("mm", "float64", 2),
    "signed": ("mm", "float32", 3),
    "taxel_force": ("N", "float32", 2),
    "taxel_closure": ("mm", "float32", 2),
    "taxel_area": ("mm^2", "float32", 2),
    "force": ("N", "float32", 2),
    "error_map": ("mm", "float16", 3),
    "error": ("mm", "float32", 1),
    "force_error": ("N", "float32", 1),
}
"""Unit, type and number of axes of each column; the first axis is the frames."""
UNITS = {name: unit for name, (unit, _, _) in COLUMNS.items()}
DTYPES = {name: dtype for name, (_, dtype, _) in COLUMNS.items()}


class VersionError(FormatError):
    """A label was written by a release with another major version of the format; it is not damaged."""


def _column(values: np.ndarray) -> pa.Array:
    flat = pa.array(np.ascontiguousarray(values).reshape(-1))
    return (
        flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, int(np.prod(values.shape[1:])))
    )


def _check(label: Label, origin: str) -> None:
    frames = len(label.time_ns)
    for name, (_, _, ndim) in COLUMNS.items():
        values = getattr(label, name)
        if values.ndim != ndim or len(values) != frames or frames == 0:
            raise FormatError(
                f"{origin}: label.{name} has shape {values.shape}",
                f"{ndim} axes, the first of {max(frames, 1)} frames as in time_ns",
                "give every array of the label one row a frame",
            )
        if not np.isfinite(values).all():
            raise FormatError(
                f"{origin}: label.{name} holds values that are not finite",
                "finite values only",
                "a solve that failed is no label: store its reason instead",
            )
    if label.tip.shape[1] != 3 or label.force.shape[1] != 3:
        raise FormatError(
            f"{origin}: tip {label.tip.shape}, force {label.force.shape}",
            "three columns each",
            "correct the label",
        )
    taxels = {name: getattr(label, name).shape[1] for name in ("taxel_force", "taxel_closure", "taxel_area")}
    if len(set(taxels.values())) > 1 or label.error_map.shape != label.signed.shape:
        raise FormatError(
            f"{origin}: taxels {taxels}, maps {label.signed.shape}, their errors {label.error_map.shape}",
            "the same number of taxels everywhere, one error a pixel",
            "correct the label",
        )
    if (np.diff(label.time_ns) <= 0).any():
        raise FormatError(
            f"{origin}: time_ns does not increase", "increasing times [ns]", "check the recording"
        )


def write(path: Path, label: Label) -> None:
    """Write a label file so that a crash leaves the old file or the new one, never a half.

    Values are kept bit for bit in the types that `Label` documents.

    Raises:
        FormatError: If the arrays' shapes contradict each other or a value is not finite.
    """
    _check(label, str(path))
    header: dict[str, Any] = {
        "version": schemas.version("label"),
        "episode": label.episode,
        "frames": len(label.time_ns),
        "pixels_x": label.signed.shape[1],
        "pixels_y": label.signed.shape[2],
        "taxels": label.taxel_force.shape[1],
        "units": UNITS,
        "provenance": label.provenance,
    }
    documents.check(header, "label", str(path))
    columns = {name: _column(np.asarray(getattr(label, name), dtype=dtype)) for name, dtype in DTYPES.items()}
    table = pa.table(columns).replace_schema_metadata({HEADER: json.dumps(header)})
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            pq.write_table(table, stream, compression="zstd", write_page_checksum=True)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


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
    if set(table.column_names) != set(DTYPES) or table.num_rows != header["frames"]:
        raise FormatError(
            f"{path}: {table.num_rows} rows of {', '.join(table.column_names)}",
            f"{header['frames']} rows of {', '.join(DTYPES)}",
            REMEDY,
        )
    shapes = {
        "tip": (3,),
        "signed": (header["pixels_x"], header["pixels_y"]),
        "error_map": (header["pixels_x"], header["pixels_y"]),
        **dict.fromkeys(("taxel_force", "taxel_closure", "taxel_area"), (header["taxels"],)),
        "force": (3,),
    }
    try:
        columns = {name: _values(table, name, (header["frames"], *shapes.get(name, ()))) for name in DTYPES}
    except (ValueError, TypeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None
    return Label(episode=header["episode"], provenance=header["provenance"], **columns)


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
    if values.dtype != DTYPES[name]:
        raise ValueError(f"column {name} is {values.dtype}, not {DTYPES[name]}")
    return values.reshape(shape)
