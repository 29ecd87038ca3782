"""Readings and a model's predictions before and after, and their file (`schemas/residuals.schema.json`)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents, schemas
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.replacement import replacement

FILE = "residuals.parquet"
HEADER = b"tacdata.residuals"
REMEDY = "run `tacdata discrepancy` again: residuals can always be made anew"


@dataclass(frozen=True)
class Residuals:
    """Readings and predictions of a model; predictions are shifted by a constant an episode, which is a nuisance."""

    episode: np.ndarray
    """Number of the episode, shape (n,), int32."""
    time: np.ndarray
    """Since the first reading of all, sessions laid end to end [s], shape (n,)."""
    phase: np.ndarray
    """Phase of the press, as an index into ``phases``, shape (n,), int8."""
    depth: np.ndarray
    """Commanded depth [mm], shape (n,), float32."""
    rate: np.ndarray
    """Commanded rate of depth [mm/s], shape (n,), float32."""
    measured: np.ndarray
    """[each stream's unit], shape (n, streams), float32; NaN where missing."""
    before: np.ndarray
    """Prediction of the model as it was given [each stream's unit], shape (n, streams), float32."""
    after: np.ndarray
    """Prediction with the effects of the verdict [each stream's unit], shape (n, streams), float32."""
    noise: np.ndarray
    """Standard deviation of each stream's noise [its unit], shape (streams,)."""
    streams: tuple[str, ...]
    """Name of each stream."""
    phases: tuple[str, ...]
    """Phases of a press."""
    names: tuple[str, ...]
    """Name of each episode."""
    sealed: tuple[int, ...] = ()
    """Episodes that the search did not use."""
    every: int = 1
    """One reading in so many is kept."""

    def standardized(self, predicted: np.ndarray) -> np.ndarray:
        """Return measured less predicted, over the noise [1], shape (n, streams)."""
        return (self.measured - predicted) / self.noise.astype(np.float32)


def write(path: Path, residuals: Residuals, verdict: str) -> None:
    """Write the file; a crash leaves the old one or the new one.

    Args:
        path: File to write.
        residuals: Content of the file.
        verdict: Content hash of the verdict that they belong to.
    """
    header: dict[str, Any] = {
        "version": schemas.version("residuals"),
        "rows": len(residuals.time),
        "every": residuals.every,
        "verdict": verdict,
        "phases": list(residuals.phases),
        "streams": list(residuals.streams),
        "noise": [float(v) for v in residuals.noise],
        "episodes": list(residuals.names),
        "sealed": list(residuals.sealed),
    }
    documents.check(header, "residuals", str(path))
    flat = {name: pa.array(getattr(residuals, name)) for name in ("episode", "time", "phase", "depth", "rate")}
    wide = {name: _wide(getattr(residuals, name)) for name in ("measured", "before", "after")}
    table = pa.table({**flat, **wide}).replace_schema_metadata({HEADER: json.dumps(header)})
    with replacement(path) as stream:
        pq.write_table(table, stream, compression="zstd", write_page_checksum=True)


def _wide(values: np.ndarray) -> pa.Array:
    return pa.FixedSizeListArray.from_arrays(pa.array(np.ascontiguousarray(values).reshape(-1)), values.shape[1])


def read(path: StrPath) -> Residuals:
    """Read the file.

    Raises:
        FormatError: If it is damaged, none of `tacdata discrepancy`, or of another major format version.
    """
    path = Path(path)
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        header = json.loads((table.schema.metadata or {})[HEADER])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(f"{path} cannot be read: {reason}", "residuals of a verdict", REMEDY) from None
    documents.check(header, "residuals", str(path))
    try:
        flat = {n: table.column(n).to_numpy() for n in ("episode", "time", "phase", "depth", "rate")}
        shape = header["rows"], len(header["streams"])
        wide = {
            n: table.column(n).combine_chunks().flatten().to_numpy(zero_copy_only=False).reshape(shape)
            for n in ("measured", "before", "after")
        }
    except (KeyError, ValueError, AttributeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None
    return Residuals(
        **flat,
        **wide,
        noise=np.array(header["noise"]),
        streams=tuple(header["streams"]),
        phases=tuple(header["phases"]),
        names=tuple(header["episodes"]),
        sealed=tuple(header["sealed"]),
        every=header["every"],
    )
