"""A case: one press for the skin model alone, from a file; its results are files to hold other codes against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from tacdata import documents
from tacdata.cases.answer import CaseAnswer, answer
from tacdata.cases.mesh import mesh_for
from tacdata.errors import UsageError
from tacdata.indenters import from_document
from tacdata.paths import StrPath
from tacdata.plans.beside_skin import check_touch
from tacdata.sensor import Sensor, default_sensor, read_sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings
from tacdata.skin.press import PressRequest


@dataclass(frozen=True)
class Case:
    """A press and the skin that it is pressed into."""

    name: str
    sensor: Sensor
    request: PressRequest
    settings: ModelSettings
    document: dict[str, Any]
    """The file's document."""
    error_estimate: bool = True
    """Whether the numerical error is wanted as well; costs about a third more, and a coarser mesh once."""


def read_case(path: StrPath) -> Case:
    """Read a case file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    path = Path(path)
    document = documents.read(path, "case")
    entry = document.get("sensor")
    if entry is None:
        sensor = default_sensor()
    elif isinstance(entry, str):
        sensor = read_sensor(path.parent / entry)
    else:
        sensor = Sensor.from_document(entry, f"{path}: sensor", path.parent)
    request = PressRequest(
        from_document(document["indenter"], f"{path}: indenter", path.parent),
        float(document.get("x", 0.0)),
        float(document.get("y", 0.0)),
        float(document.get("yaw", 0.0)),
        tuple(float(d) for d in document["depths"]),
        float(document.get("tilt_x", 0.0)),
        float(document.get("tilt_y", 0.0)),
    )
    deepest, upright = max(request.depths), request.tilt_x == request.tilt_y == 0
    if upright and deepest > 0 and not sensor.skin.curved:
        size = sensor.skin.size_x, sensor.skin.size_y
        check_touch(request.indenter, size, (request.x, request.y), request.yaw, deepest, str(path))
    mesh = mesh_for(sensor, request)
    if "mesh" in document:
        focus = document["mesh"].get("focus")
        mesh = MeshSettings(**dict[str, Any](document["mesh"], focus=tuple(focus) if focus else None))
    # The estimate is made apart from the states, so that their times are their own.
    pointwise = document.get("volumes") == "points"
    settings = ModelSettings(mesh=mesh, error_estimate=False, averaged_from=0.5 if pointwise else 0.0)
    return Case(document["name"], sensor, request, settings, document, document.get("error_estimate", True))


@threadpool_limits.wrap(limits=1)  # as in tacdata.pipeline.skin_press
def solve_case(
    case: Case, folder: Path, done: Callable[[float], None] = lambda depth: None, picture: bool = False
) -> Path:
    """Solve a case and write ``<name>.parquet`` and ``<name>.json`` into ``folder``, and ``<name>.png`` if wanted.

    Args:
        case: The case.
        folder: Folder for the results.
        done: Called with each depth [mm] that is solved.
        picture: Whether to draw the deepest state.

    Returns:
        The JSON file.

    Raises:
        UsageError: If results of that name lie there already.
        SolveError: If the press is impossible or an equilibrium is not found.
    """
    report, table, drawing = (folder / f"{case.name}.{ending}" for ending in ("json", "parquet", "png"))
    for path in (report, table, *([drawing] if picture else [])):
        if path.exists():
            raise UsageError(
                f"{path} exists", "a folder without it: results are never overwritten", "choose another --out"
            )
    result: CaseAnswer = answer(case.sensor, case.request, case.settings, case.error_estimate, done)
    folder.mkdir(parents=True, exist_ok=True)
    result.write_table(table, case.name)
    document = {**result.document, "case": case.document, "displacements": table.name}
    if picture:
        from tacdata.cases.picture import draw

        draw(drawing, case.name, result)
        document["picture"] = drawing.name
    documents.write(report, document, "case_result")
    return report
