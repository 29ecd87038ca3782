"""The depth maps predicted for an episode, and their file (`schemas/prediction.schema.json`)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents, schemas
from tacdata.display import Displayed
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.replacement import replacement

HEADER = b"tacdata.prediction"
UNITS = {"time_ns": "ns", "depth": "mm"}
REMEDY = "run `tacdata evaluate` again: predictions can always be made anew"


@dataclass(frozen=True, repr=False)
class PredictedMaps(Displayed):
    """The predicted maps of one episode, frame by frame."""

    episode: int
    """Number of the episode in the dataset."""
    time_ns: np.ndarray
    """Time of each frame [ns], shape (n,), int64: the recording's estimated sample times."""
    depth: np.ndarray
    """Predicted depth [mm], shape (n, pixels_x, pixels_y), float32, 0 to D_max."""
    part: str
    """Role of the episode in training: "train", "validation", "test", or "other dataset"."""
    checkpoint: str
    """SHA-256 of the checkpoint file."""
    network: str
    """Name of the network."""
    dataset: str
    """Identity of the dataset."""
    sensor: str
    """Content hash of the sensor."""
    provenance: dict[str, Any]
    """Its origin."""

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: maps, network, deepest pixel."""
        frames, *pixels = self.depth.shape
        yield f"Prediction for episode {self.episode}: {frames} maps of {pixels[0]} × {pixels[1]} pixels"
        yield f"network {self.network} ({self.checkpoint[:12]}); role of the episode in its training: {self.part}"
        yield f"deepest pixel {self.depth.max(initial=0.0):.3g} mm"


def file_name(episode: int) -> str:
    """Return the name of an episode's prediction file."""
    return f"episode-{episode:06d}.parquet"


def write_prediction(path: Path, prediction: PredictedMaps) -> None:
    """Write a prediction file; a crash leaves the old file or the new one.

    Raises:
        FormatError: If the arrays contradict each other or a value is not finite.
    """
    depth = np.ascontiguousarray(prediction.depth, dtype=np.float32)
    if depth.ndim != 3 or len(depth) != len(prediction.time_ns) or not np.isfinite(depth).all():
        raise FormatError(
            f"{path}: maps {depth.shape} for {len(prediction.time_ns)} times", "one finite map a frame", "predict again"
        )
    _, pixels_x, pixels_y = depth.shape
    named = {k: v for k, v in vars(prediction).items() if k not in ("time_ns", "depth")}
    header = {
        "version": schemas.version("prediction"),
        "frames": len(depth),
        "pixels_x": pixels_x,
        "pixels_y": pixels_y,
        "units": UNITS,
        **named,
    }
    documents.check(header, "prediction", str(path))
    table = pa.table(
        {
            "time_ns": pa.array(np.asarray(prediction.time_ns, dtype=np.int64)),
            "depth": pa.FixedSizeListArray.from_arrays(pa.array(depth.reshape(-1)), pixels_x * pixels_y),
        }
    ).replace_schema_metadata({HEADER: json.dumps(header)})
    with replacement(path) as stream:
        pq.write_table(table, stream, compression="zstd", write_page_checksum=True)


def read_prediction(path: StrPath) -> PredictedMaps:
    """Read a prediction file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, no prediction file, or of another major format version.
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"no prediction file {path}", "a file that `tacdata evaluate` wrote", "run `tacdata evaluate`")
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        header = json.loads((table.schema.metadata or {})[HEADER])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        raise FormatError(
            f"{path} is no readable prediction file: {str(error).splitlines()[0]}",
            "a file that `tacdata evaluate` wrote",
            REMEDY,
        ) from None
    documents.check(header, "prediction", str(path))
    shape = (header["frames"], header["pixels_x"], header["pixels_y"])
    try:
        depth = table.column("depth").combine_chunks().flatten().to_numpy().reshape(shape)
        time_ns = table.column("time_ns").to_numpy().reshape(shape[0])
    except (KeyError, ValueError, AttributeError, pa.ArrowException) as error:
        raise FormatError(f"{path}: {error}", "columns as its header says", REMEDY) from None
    named = {k: header[k] for k in ("episode", "part", "checkpoint", "network", "dataset", "sensor", "provenance")}
    return PredictedMaps(time_ns=time_ns, depth=depth, **named)
