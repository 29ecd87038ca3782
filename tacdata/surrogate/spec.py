"""Writes a table of presses as the response of a model spec."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.errors import UsageError
from tacdata.surrogate.build import LeftOut, Work
from tacdata.surrogate.table import LoadTable

SPEC, TABLE = "spec.json", "response.npz"


def written_spec(folder: Path, work: Work, table: LoadTable, deviation: LeftOut | None) -> Path:
    """Write the table and a model spec without effects that uses it; return the spec's path.

    Args:
        folder: A new or empty folder.
        work: The work that made the table.
        table: The table.
        deviation: Its interpolation error.

    Raises:
        UsageError: If the folder holds a spec or a table already.
    """
    # Other files may lie in the folder; these two are never overwritten.
    for name in (SPEC, TABLE):
        if (folder / name).exists():
            raise UsageError(f"{folder / name} exists", "a new folder; nothing is overwritten", "choose another --out")
    folder.mkdir(parents=True, exist_ok=True)
    parameters = {
        "mesh": asdict(work.model.settings.mesh),
        "spacing": float(work.grid.x[1] - work.grid.x[0]),
        "left_out": asdict(deviation) if deviation else None,
        "load": table.reading.by,
        "tools": {name: r.indenter.document for name, r in zip(work.names, work.reaches, strict=True)},
    }
    table.write(folder / TABLE, provenance.stamp("tacdata.surrogate", dict(work.model.identity), parameters))
    document: dict[str, Any] = {
        "version": schemas.version("model_spec"),
        "name": f"{work.sensor.name}, finite elements",
        "parent": None,
        "response": {"kind": "table", "file": TABLE},
        "effects": [],
    }
    documents.write(folder / SPEC, document, "model_spec")
    return folder / SPEC
