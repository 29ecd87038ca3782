"""Solved presses with their maps, in one file: the basis of the study's readings and of its network's labels."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np
from threadpoolctl import threadpool_limits

from tacdata import provenance
from tacdata.errors import FormatError, SolveError
from tacdata.labels import PathSolution
from tacdata.paths import StrPath
from tacdata.replacement import replacement
from tacdata.sensor import Sensor
from tacdata.transduction import Loads, Transducer

if TYPE_CHECKING:
    from tacdata.skin.model import SkinModel
    from tacdata.skin.press import PressRequest

FOLDER = Path(__file__).parent / "presses"
"""Folder of the presses that ship, made by `python -m tacdata.grasping.pin_presses`."""
GRAIN = 0.002
"""Resolution of stored maps [mm]; it keeps files small and suffices for labels."""
LEAST = 4
"""A press without an equilibrium at its end is tried less deep, while at least this many depths are left [count]."""
FIELDS = ("place", "counts", "depths", "surface", "force", "closure", "area", "normal")


@dataclass(frozen=True)
class PressSet:
    """Presses of one skin model, loading only."""

    indenters: tuple[dict[str, Any], ...]
    """Document of each press's indenter."""
    place: np.ndarray
    """x, y [mm] and yaw [deg], shape (n, 3)."""
    counts: np.ndarray
    """States solved [count], shape (n,); 0 where a press has no equilibrium."""
    depths: np.ndarray
    """Depth of each state [mm], shape (n, k)."""
    surface: np.ndarray
    """Height change of the surface at the pixels, undeformed minus deformed [mm], shape (n, k, pixels_x, pixels_y)."""
    force: np.ndarray
    """Normal force on each protrusion [N], shape (n, k, taxels)."""
    closure: np.ndarray
    """Closure of each protrusion [mm], shape (n, k, taxels)."""
    area: np.ndarray
    """Contact area of each protrusion [mm^2], shape (n, k, taxels)."""
    normal: np.ndarray
    """Normal force on the indenter [N], shape (n, k)."""
    provenance: dict[str, Any]
    """Versions and hashes of its sources, the skin model's among them."""

    def signals(self, sensor: Sensor) -> np.ndarray:
        """Return tared readings without noise [counts], shape (n, k, taxels), by the sensor's transduction."""
        transducer = Transducer.of(sensor)
        flat = Loads(*(v.reshape(-1, sensor.taxels.count).astype(float) for v in (self.force, self.closure, self.area)))
        return (transducer.read(flat).counts - transducer.offset).reshape(self.force.shape)

    def write(self, path: Path) -> None:
        """Write the file (.npz)."""
        buffer, values = io.BytesIO(), {name: getattr(self, name) for name in FIELDS}
        # Single precision is finer than the solver's own error.
        values |= {name: values[name].astype(np.float32) for name in ("force", "closure", "area", "normal")}
        values["surface"] = np.round(self.surface / GRAIN).astype(np.int16)
        stamp, indenters = provenance.canonical(self.provenance), json.dumps(self.indenters)
        np.savez_compressed(buffer, indenters=np.array(indenters), provenance=np.array(stamp), **values)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacement(path) as stream:
            stream.write(buffer.getvalue())


def read_presses(path: StrPath, sensor: Sensor) -> PressSet:
    """Read presses of a sensor.

    Raises:
        FormatError: If the file is damaged, missing or of another sensor.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            values = {name: data[name] for name in FIELDS}
            stamp, indenters = json.loads(str(data["provenance"])), json.loads(str(data["indenters"]))
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        remedy = "install tacdata again, or run python -m tacdata.grasping.pin_presses"
        raise FormatError(f"{path}: {error}", "presses that pin_presses wrote", remedy) from None
    # Presses of another sensor would give readings without a warning.
    if stamp["parents"].get("sensor") != sensor.content_hash:
        raise FormatError(
            f"{path}: presses of another sensor",
            f"sensor {sensor.content_hash[:12]} ({sensor.name})",
            "run python -m tacdata.grasping.pin_presses",
        )
    values["surface"] = values["surface"].astype(np.float32) * GRAIN
    return PressSet(tuple(indenters), **values, provenance=stamp)


@threadpool_limits.wrap(limits=1)  # as in tacdata.pipeline.skin_press
def solved_presses(model: SkinModel, requests: Sequence[PressRequest], capacity: int = 1) -> PressSet:
    """Solve presses.

    One without equilibrium at its deepest state is tried less deep; if none is found, it has no states.

    Args:
        model: The skin.
        requests: Presses with the same number of depths, loading only.
        capacity: Presses solved at the same time.
    """
    answers: dict[int, PathSolution] = {}
    todo = dict(enumerate(requests))
    while todo:
        numbers, again = list(todo), {}
        for index, answer in model.solve_many([todo[k] for k in numbers], capacity):
            k = numbers[index]
            if not isinstance(answer, SolveError):
                answers[k] = answer
            # One depth less each time, until there is an equilibrium.
            elif len(todo[k].depths) > LEAST:
                again[k] = replace(todo[k], depths=todo[k].depths[:-1])
        todo = again
    return _collected(model, requests, answers)


def _collected(model: SkinModel, requests: Sequence[PressRequest], answers: dict[int, PathSolution]) -> PressSet:
    sensor, n, states = model.sensor, len(requests), max(len(p.depths) for p in requests)
    load = (n, states, sensor.taxels.count)
    counts, depths, normal = np.zeros(n, dtype=int), np.zeros((n, states)), np.zeros((n, states))
    surface, loads = np.zeros((n, states, *sensor.map.shape)), [np.zeros(load) for _ in range(3)]
    for k, answer in answers.items():
        q = counts[k] = len(answer.depth)
        depths[k, :q], surface[k, :q], normal[k, :q] = answer.depth, answer.surface, answer.force[:, 2]
        for values, solved in zip(loads, (answer.taxel_force, answer.taxel_closure, answer.taxel_area), strict=True):
            values[k, :q] = solved
    place = np.array([(p.x, p.y, p.yaw) for p in requests])
    stamp = provenance.stamp("tacdata.grasping.pin_presses", dict(model.identity), {"presses": n})
    indenters = tuple(p.indenter.document for p in requests)
    return PressSet(indenters, place, counts, depths, surface, *loads, normal, stamp)
