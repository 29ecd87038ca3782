"""From a request and the solution of its path to the episode's label."""

from __future__ import annotations

import numpy as np

from label_farm.interpolate import Branch
from label_farm.plan import LabelRequest
from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.labels import Label, PathSolution

ERROR = (
    "root mean square over the pixels: interpolation between states + offset from the solved configuration"
)


def make_label(request: LabelRequest, solution: PathSolution | None) -> Label:
    """Return the label of an episode: each frame takes its map from the prescribed configuration at its time.

    Frames up to the deepest point follow the loading branch, later ones the unloading branch; frames whose
    nominal pose does not touch have a zero map. `Label.error` holds what is lost by interpolating and by
    sharing one path among nearly equal presses; the solver's own errors (mesh, residual) are not in it.

    Args:
        request: The frames.
        solution: The solved path of ``request.job``; None if that is None.

    Raises:
        SolveError: If there is a job and no solution.
    """
    if request.job is not None and solution is None:
        raise SolveError(
            f"episode {request.episode} has no solution", "a solved path", "run `tacdata label` again"
        )
    frames, shape = len(request.time_ns), request.sensor.map.shape
    signed = np.zeros((frames, *shape))
    error = np.maximum(request.tip[:, 2], 0.0)
    taxel_force, force = np.zeros((frames, request.sensor.taxels.count)), np.zeros((frames, 3))
    if solution is not None:
        error = np.zeros(frames)
        for loading in (True, False):
            chosen = ((request.time_ns <= request.deepest_ns) == loading) & (request.tip[:, 2] > 0)
            if chosen.any():
                depth = request.tip[chosen, 2]
                surface = Branch.of(solution, "surface", loading)
                signed[chosen] = surface.at(depth).reshape(-1, *shape)
                bound = surface.bound(depth).reshape(-1, *shape) + _offset(request, signed[chosen], chosen)
                error[chosen] = np.sqrt((bound**2).mean(axis=(1, 2)))
                taxel_force[chosen] = Branch.of(solution, "taxel_force", loading).at(depth)
                force[chosen] = Branch.of(solution, "force", loading).at(depth)
    return Label(
        episode=request.episode,
        time_ns=np.asarray(request.time_ns, dtype=np.int64),
        tip=request.tip,
        signed=signed.astype(np.float32),
        taxel_force=taxel_force.astype(np.float32),
        force=force.astype(np.float32),
        error=error.astype(np.float32),
        provenance=_provenance(request, solution),
    )


def parents(request: LabelRequest) -> dict[str, str]:
    """Return what a label of this request is made from, by name and hash; equal parents, equal label."""
    made_from = {
        "recording": request.recording,
        "sensor": request.sensor.content_hash,
        "model": request.model,
        "label_farm": provenance.source_hash("label_farm"),
    }
    return made_from if request.job is None else {**made_from, "solution": request.job.key}


def _offset(request: LabelRequest, signed: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Change of the map [mm] if it is moved from the solved place to the frame's own."""
    if request.job is None:
        return np.zeros_like(signed)
    moved = request.tip[chosen, :2] - np.array([request.job.x, request.job.y])
    along_x, along_y = np.gradient(signed, request.sensor.map.pixel_pitch, axis=(1, 2))
    return np.abs(along_x * moved[:, 0, None, None] + along_y * moved[:, 1, None, None])


def _provenance(request: LabelRequest, solution: PathSolution | None) -> dict:
    parameters = {
        "error": ERROR,
        "job": request.job.document if request.job else None,
        "solver": solution.provenance if solution else None,
    }
    return provenance.stamp("tacdata label", parents(request), parameters)
