"""Result of the skin model for a case: states of one press, as a table of displacements and a document."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import provenance, schemas
from tacdata.plans.beside_skin import tip_aside
from tacdata.sensor import Sensor
from tacdata.skin.contact.first_touch import reach
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.mesh.generation.true_volume import volume_error
from tacdata.skin.mesh.skin_mesh import quality
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.equilibrium import Equilibrium
from tacdata.skin.validity import fineness
from tacdata.skin.validity.mesh_error import Figures, NumericalError
from tacdata.transduction import Loads, TaxelReadings, Transducer


@dataclass(frozen=True)
class CaseAnswer:
    """A solved case."""

    model: SkinModel
    """The model that solved it."""
    request: PressRequest
    """The press."""
    states: list[Equilibrium]
    """One for each depth of the request."""
    seconds: list[float]
    """Time of each state [s]."""
    figures: Figures
    """Maps and forces of the states."""
    error: NumericalError | None
    """Of the states; None if not asked for."""
    error_seconds: float
    """Time of the estimate, the making of a coarser mesh included if it was needed [s]."""

    @cached_property
    def readings(self) -> TaxelReadings | None:
        """Readings of the taxels; None if the skin has none or the sensor file does not describe them."""
        sensor = self.model.sensor
        if sensor.transduction is None or not sensor.skin.protrusion_radius or not sensor.contact.board:
            return None
        loads = (np.array([getattr(s, f"taxel_{name}") for s in self.states]) for name in ("force", "closure", "area"))
        return Transducer.of(sensor).read(Loads(*loads))

    @property
    def document(self) -> dict[str, Any]:
        """The forces as in `schemas/case_result.schema.json`, without the names of case and files."""
        stamp = provenance.stamp("tacdata solve", self.model.identity, {"settings": asdict(self.model.settings)})
        document = {
            "version": schemas.version("case_result"),
            "mesh": {
                **{k: float(v) for k, v in asdict(quality(self.model.mesh)).items()},
                "volume_error": volume_error(self.model.sensor, self.model.mesh),
            },
            "results": [self._result(k) for k in range(len(self.states))],
            "remarks": [*self.model.remarks, *(self.readings.remarks if self.readings else ())],
            "provenance": stamp,
        }
        extent = reach(self.model.sensor, self.request)
        if blunt := fineness.remark(self.model.mesh, self.model.sensor, self.request, extent):
            document["remarks"].append(blunt)
        if aside := tip_aside(self.request.indenter):
            document["remarks"].append(aside)
        if self.error is not None:
            document["error_seconds"] = round(self.error_seconds, 3)
            if self.error.remark:
                document["remarks"].append(f"numerical error: {self.error.remark}")
        return document

    def _result(self, k: int) -> dict[str, Any]:
        state = self.states[k]
        result = {
            "depth": self.request.depths[k],
            "force_N": state.force.tolist(),
            "protrusion_force_N": state.taxel_force.tolist(),
            "protrusion_closure_mm": state.taxel_closure.tolist(),
            "protrusion_contact_area_mm2": state.taxel_area.tolist(),
            "residual": state.residual,
            "misfit_um": 1e3 * state.penetration,
            "newton": state.newton,
            "seconds": round(self.seconds[k], 3),
        }
        if self.readings:
            result["readings"] = {
                "counts": self.readings.counts[k].tolist(),
                "capacitance_pF": self.readings.capacitance[k].tolist(),
                "saturated": self.readings.saturated[k].tolist(),
            }
        if self.error is not None:
            surface = self.error.surface[k]
            result["numerical_error"] = {
                "force_N": float(self.error.force[k]),
                "protrusion_force_N": self.error.taxel_force[k].tolist(),
                "map_rms_mm": float(np.sqrt((surface**2).mean())),
                "map_max_mm": float(surface.max()),
            }
        return result

    def write_table(self, path: Path, name: str) -> None:
        """Write the displacements of the outer face's nodes as Parquet; first under a temporary name."""
        top = np.unique(self.model.mesh.outer)
        place, count = self.model.mesh.nodes[top], len(self.states)
        displacements = np.concatenate([state.displacement[top] for state in self.states])
        columns: dict[str, Any] = {
            "case": pa.array([name] * (count * len(top))).dictionary_encode(),
            "depth": np.repeat(self.request.depths, len(top)),
            **{axis: np.tile(place[:, k], count) for k, axis in enumerate("xy")},
            **{f"u{axis}": displacements[:, k] for k, axis in enumerate("xyz")},
        }
        stamp = provenance.stamp("tacdata solve", self.model.identity, {"settings": asdict(self.model.settings)})
        table = pa.table(columns).replace_schema_metadata({"tacdata": provenance.canonical(stamp)})
        temporary = path.with_name(f".{path.name}.partial")
        pq.write_table(table, temporary)
        temporary.replace(path)


def answer(
    sensor: Sensor,
    request: PressRequest,
    settings: ModelSettings,
    error_estimate: bool,
    done: Callable[[float], None] = lambda depth: None,
) -> CaseAnswer:
    """Solve a press with a model of its own.

    Args:
        sensor: Whose skin.
        request: The press.
        settings: Discretization and solver.
        error_estimate: Whether to press a coarser mesh as well.
        done: Called with each depth [mm] that is solved.

    Raises:
        SolveError: If the press is impossible or an equilibrium is not found.
    """
    check_press(request, sensor)  # before seconds or minutes go into a mesh
    model = SkinModel(sensor, settings)
    states, seconds, began = [], [], time.perf_counter()
    for depth, state in model.states(request):
        states.append(state)
        seconds.append(time.perf_counter() - began)
        done(depth)
        began = time.perf_counter()
    figures = model.figures(request, request.depths, states)
    began = time.perf_counter()
    error = model.numerical_error(request, figures) if error_estimate else None
    return CaseAnswer(model, request, states, seconds, figures, error, time.perf_counter() - began)
