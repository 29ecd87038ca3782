"""Makes an episode's label from its frames and the solved press."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.label_farm.labels.request import LabelRequest, Planned
from tacdata.label_farm.presses.interpolate import Branch
from tacdata.labels import Label, PathSolution, columns
from tacdata.sensor import Sensor
from tacdata.transduction import Loads, Transducer

ERROR = (
    "of each pixel: root sum of squares of (interpolation between states + offset from the solved configuration) and "
    "of the mesh's estimate; error is its root mean square over the pixels"
)
LOADS = ("taxel_force", "taxel_closure", "taxel_area")
"""Loads of each taxel, in the order of `Loads`."""
COMPUTED = ("signed", "error_map", "force", "force_error", "interpolation_error")
"""Quantities that a label computes from several of its path, or with a bound on their error."""
CARRIED = tuple(name for name in columns.ALL if name in columns.PATH and name not in COMPUTED)
"""Quantities that a label interpolates from those of the same name in its path, if the path has them."""

_DECIDING = (
    "tacdata.label_farm.presses.interpolate",
    "tacdata.label_farm.labels.make_label",
    "tacdata.label_farm.labels.request",
    "tacdata.transduction",
)
"""Code that decides the label of a solution; engines and services do not."""


def make_label(request: LabelRequest, solution: PathSolution | None) -> Label:
    """Return the label of an episode: each frame takes its map from the prescribed configuration at its time.

    Frames up to the deepest point follow the loading branch, later ones the unloading branch; frames whose
    nominal pose does not touch have a zero map. Readings are those that the sensor file's transduction makes of the
    frame's loads. `Label.error_map` joins the loss by interpolating and by
    sharing one path among nearly equal presses, a bound, with the error that the mesh leaves, an estimate: as the root
    of the sum of their squares, since neither knows of the other. The solver's tolerances are not in it.

    Args:
        request: The frames.
        solution: The solved path of ``request.job``; None if that is None.

    Raises:
        SolveError: If there is a job and no solution.
    """
    if request.job is not None and solution is None:
        raise SolveError(f"episode {request.episode} has no solution", "a solved path", "run `tacdata label` again")
    values = _along_path(request, solution) if solution else _untouched(request)
    error_map = values["error_map"]
    readings, remarks = _readings(request.sensor, values)
    values |= readings
    return Label(
        episode=request.episode,
        time_ns=np.asarray(request.time_ns, dtype=np.int64),
        tip=request.tip,
        error=np.sqrt((error_map**2).mean(axis=(1, 2))).astype(np.float32),
        provenance=_provenance(request, solution, remarks),
        **{name: values[name].astype(columns.ALL[name].dtype) for name in values},
    )


def _untouched(request: LabelRequest) -> dict[str, np.ndarray]:
    """Return zeros; the error of a frame that touches in spite of its plan is up to its depth.

    Without contact no spread acts. A spread of height that leads to contact is not followed.
    """
    met = {"": True, "board": bool(request.sensor.contact.board), "spreads": bool(request.sensor.uncertainty)}
    zeros = _zeros(request, [name for name in CARRIED if met[columns.PATH[name].needs]])
    doubt = np.maximum(request.tip[:, 2], 0.0)
    return zeros | {"error_map": np.broadcast_to(doubt[:, None, None], zeros["signed"].shape)}


def _zeros(request: LabelRequest, carried: Sequence[str]) -> dict[str, np.ndarray]:
    size = len(request.time_ns), request.sensor.map.shape, request.sensor.taxels.count
    return {name: np.zeros(columns.ALL[name].shape(*size)) for name in (*COMPUTED, *carried)}


def _along_path(request: LabelRequest, solution: PathSolution) -> dict[str, np.ndarray]:
    """Return each frame's values from the neighbouring states of its branch."""
    carried = [name for name in CARRIED if getattr(solution, name) is not None]
    values = _zeros(request, carried)
    for loading in (True, False):
        # Friction makes the two branches differ at the same depth.
        frames = ((request.time_ns <= request.deepest_ns) == loading) & (request.tip[:, 2] > 0)
        if not frames.any():
            continue
        depth, shape = request.tip[frames, 2], (-1, *request.sensor.map.shape)
        surface, force = Branch.of(solution, "surface", loading), Branch.of(solution, "force", loading)
        mesh, mesh_force = (Branch.of(solution, name, loading).at(depth) for name in ("numerical", "force_error"))
        signed = values["signed"][frames] = surface.at(depth).reshape(shape)
        bound = surface.bound(depth).reshape(shape) + _offset(request, signed, frames)
        # Interpolation and offset may point the same way and are added; the mesh's error is independent of them.
        values["error_map"][frames] = np.hypot(bound, mesh.reshape(shape))
        values["force"][frames] = force.at(depth)
        lost = np.linalg.norm(force.bound(depth), axis=1)
        values["force_error"][frames] = np.hypot(lost, mesh_force[:, 0])
        values["interpolation_error"][frames] = surface.left_out_beside(depth)
        for name in carried:
            states = Branch.of(solution, name, loading).at(depth)
            values[name][frames] = states.reshape(-1, *values[name].shape[1:])
    return values


def _readings(sensor: Sensor, values: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Return the taxels' readings and remarks on saturation; none for a sensor without transduction."""
    if sensor.transduction is None:
        return {}, ()
    readings = Transducer.of(sensor).read(Loads(*(values[name] for name in LOADS)))
    return {"taxel_capacitance": readings.capacitance, "taxel_counts": readings.counts}, readings.remarks


def code_hash() -> str:
    """Return the version of the code that turns recordings and solutions into labels (hex, 64 characters)."""
    return provenance.code_hash(*_DECIDING)


def parents(request: LabelRequest | Planned) -> dict[str, str]:
    """Return the hashes of all inputs of a label, by name. Equal hashes give an equal label."""
    made_from = {
        "recording": request.recording,
        "sensor": request.sensor.content_hash,
        "model": request.model,
        "label_farm": code_hash(),
    }
    if request.sensor.transduction is not None:
        made_from["transduction"] = request.sensor.transduction.content_hash
    return made_from if request.job is None else {**made_from, "solution": request.job.key}


def _offset(request: LabelRequest, signed: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Change of the map [mm] if it is moved from the solved place to the frame's own."""
    if request.job is None:
        return np.zeros_like(signed)
    shift = request.tip[frames, :2] - np.array([request.job.x, request.job.y])
    along_x, along_y = np.gradient(signed, request.sensor.map.pixel_pitch, axis=(1, 2))
    return np.abs(along_x * shift[:, 0, None, None] + along_y * shift[:, 1, None, None])


def _provenance(request: LabelRequest, solution: PathSolution | None, remarks: tuple[str, ...]) -> dict:
    transduction = request.sensor.transduction
    parameters = {
        "error": ERROR,
        "job": request.job.document if request.job else None,
        "solver": solution.provenance if solution else None,
        "transduction": transduction.document if transduction else None,
        "readings": list(remarks),
    }
    return provenance.stamp("tacdata label", parents(request), parameters)
