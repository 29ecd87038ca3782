"""A case: one press for the skin model alone, from a file; its results are files to hold other codes against."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import schemas
from tacdata import documents, provenance
from tacdata.errors import UsageError
from tacdata.indenters import from_document
from tacdata.sensor import Sensor, default_sensor, read_sensor
from tacdata.skin.mesh import quality
from tacdata.skin.mesher import MeshSettings
from tacdata.skin.press import ModelSettings, PressRequest, SkinModel


@dataclass(frozen=True)
class Case:
    """A press and the skin that it is pressed into."""

    name: str
    sensor: Sensor
    request: PressRequest
    settings: ModelSettings
    document: dict[str, Any]
    """The file's document."""


def read_case(path: Path) -> Case:
    """Read a case file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    document = documents.read(path, "case")
    given = document.get("sensor")
    if given is None:
        sensor = default_sensor()
    elif isinstance(given, str):
        sensor = read_sensor(path.parent / given)
    else:
        sensor = Sensor.from_document(given, f"{path}: sensor")
    request = PressRequest(
        from_document(document["indenter"], f"{path}: indenter"), float(document.get("x", 0.0)),
        float(document.get("y", 0.0)), float(document.get("yaw", 0.0)), tuple(float(d) for d in document["depths"]),
    )
    mesh = dict(document.get("mesh", {}))
    if "focus" in mesh:
        mesh["focus"] = tuple(mesh["focus"])
    return Case(document["name"], sensor, request, ModelSettings(mesh=MeshSettings(**mesh)), document)


def solve_case(case: Case, out: Path, done: Callable[[float], None] = lambda depth: None) -> Path:
    """Solve a case and write ``<name>.parquet`` and ``<name>.json`` into ``out``.

    Args:
        case: What to solve.
        out: Folder for the results.
        done: Called with each depth [mm] that is solved.

    Returns:
        The JSON file.

    Raises:
        UsageError: If results of that name lie there already.
        SolveError: If the press is impossible or an equilibrium is not found.
    """
    report, table = out / f"{case.name}.json", out / f"{case.name}.parquet"
    for path in (report, table):
        if path.exists():
            raise UsageError(
                f"{path} exists", "a folder without it: results are never overwritten", "choose another --out"
            )
    model = SkinModel(case.sensor, case.settings)
    top = np.unique(model.mesh.outer)
    columns: dict[str, list[np.ndarray]] = {k: [] for k in ("depth", "x", "y", "ux", "uy", "uz")}
    results = []
    began = time.perf_counter()
    for depth, state in model.states(case.request):
        seconds, began = time.perf_counter() - began, time.perf_counter()
        place, moved = model.mesh.nodes[top], state.displacement[top]
        for name, values in zip(columns, [np.full(len(top), depth), *place[:, :2].T, *moved.T], strict=True):
            columns[name].append(values)
        results.append(
            {
                "depth": depth, "force_N": state.force.tolist(), "protrusion_force_N": state.taxel_force.tolist(),
                "residual": float(state.outcome.residual[0]), "misfit_um": 1e3 * float(state.outcome.penetration[0]),
                "newton": state.outcome.newton, "cg": state.outcome.cg, "seconds": round(seconds, 3),
            }
        )
        done(depth)
    stamp = provenance.stamp("tacdata solve", model.identity, {"settings": asdict(case.settings)})
    out.mkdir(parents=True, exist_ok=True)
    _write_table(table, case.name, columns, provenance.canonical(stamp))
    document = {
        "version": schemas.version("case_result"), "case": case.document, "displacements": table.name,
        "mesh": {k: float(v) for k, v in asdict(quality(model.mesh)).items()}, "results": results, "provenance": stamp,
    }
    documents.write(report, document, "case_result")
    return report


def _write_table(path: Path, name: str, columns: dict[str, list[np.ndarray]], stamp: str) -> None:
    arrays = {k: np.concatenate(v) for k, v in columns.items()}
    table = pa.table({"case": pa.array([name] * len(arrays["depth"])).dictionary_encode(), **arrays})
    temporary = path.with_name(f".{path.name}.partial")
    pq.write_table(table.replace_schema_metadata({"tacdata": stamp}), temporary)
    temporary.replace(path)
