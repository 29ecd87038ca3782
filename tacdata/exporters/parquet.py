"""Parquet, one file per demonstration, with the meaning of its columns in the header."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import Exporter, new_folder
from tacdata.replacement import replacement
from tacdata.replay.columns import from_columns, to_columns
from tacdata.replay.targets import FingertipTargets

HEADER = b"tacdata.fingertip_targets"


class Parquet(Exporter):
    """``NAME.parquet``; the header is the document of `schemas/fingertip_targets.schema.json`."""

    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Write a new folder."""
        new_folder(directory)
        for targets in episodes:
            columns = to_columns(targets)
            # In the file itself, so that the numbers never part from their meaning.
            header = {HEADER: json.dumps(targets.header(columns))}
            with replacement(directory / f"{Path(targets.recording).stem}.parquet") as stream:
                table = pa.table(columns).replace_schema_metadata(header)
                pq.write_table(table, stream, compression="zstd", write_page_checksum=True)
        return []

    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the targets of a folder."""
        paths = sorted(Path(directory).glob("*.parquet"))
        if not paths:
            allowed = "a folder that tacdata export --format parquet wrote"
            raise UsageError(f"no Parquet file in {directory}", allowed, "check the path")
        return [_read(path) for path in paths]


def _read(path: Path) -> FingertipTargets:
    try:
        table = pq.read_table(path, page_checksum_verification=True)
        header = json.loads((table.schema.metadata or {})[HEADER])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(f"{path} holds no targets: {reason}", "a file of tacdata export", "export again") from None
    columns = {name: np.asarray(table.column(name).to_numpy()) for name in table.column_names}
    return from_columns(header, columns, str(path))
