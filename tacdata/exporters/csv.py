"""Plain CSV, one file per demonstration, and a JSON file that explains the columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.exporters.exporter import Exporter, new_folder
from tacdata.replay.columns import from_columns, to_columns
from tacdata.replay.targets import FingertipTargets


class Csv(Exporter):
    """``NAME.csv`` with units in the columns' names, and ``NAME.json`` (`schemas/fingertip_targets.schema.json`)."""

    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Write a new folder; numbers are exact to the last bit."""
        new_folder(directory)
        for targets in episodes:
            columns, stem = to_columns(targets), Path(targets.recording).stem
            text = io.StringIO()
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow(columns)
            # Python prints the fewest digits that give the same number back, so nothing is lost.
            rows.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
            # The description first: a table without one cannot be read.
            documents.write(directory / f"{stem}.json", targets.header(columns), "fingertip_targets")
            documents.write_text(directory / f"{stem}.csv", text.getvalue())
        return []

    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the targets of a folder."""
        paths = sorted(Path(directory).glob("*.csv"))
        if not paths:
            allowed = "a folder that tacdata export --format csv wrote"
            raise UsageError(f"no CSV file in {directory}", allowed, "check the path")
        return [_read(path) for path in paths]


def _read(path: Path) -> FingertipTargets:
    header = documents.read(path.with_suffix(".json"), "fingertip_targets")
    try:
        with path.open(newline="") as stream:
            rows = list(csv.reader(stream))
        names, *values = rows
        table = dict(zip(names, zip(*values, strict=True), strict=True))
        columns = {n: np.array(v, np.int64 if n == "time_ns" else float) for n, v in table.items()}
    except (OSError, ValueError, csv.Error) as error:
        allowed = "rows of numbers under one line of names"
        raise FormatError(f"{path} cannot be read: {error}", allowed, "export again") from None
    return from_columns(header, columns, str(path))
