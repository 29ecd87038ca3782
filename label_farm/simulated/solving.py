"""Solves the presses of a simulation in batches, in this process."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tacdata.errors import SolveError
from tacdata.indenters import from_document
from tacdata.label_farm.simulated.shard import Shard
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.specimen import stretched
from tacdata.labels import PathSolution

if TYPE_CHECKING:
    from tacdata.skin.model import SkinModel

_AT_A_TIME = {"cpu": 8, "cuda": 512}
"""How many presses a device solves at a time [count], as in `label_farm.presses.fem`."""
_IN_A_FILE = {"cpu": 16, "cuda": 1024}
"""How many presses are solved between two writes [count]; so many are solved again after a crash."""


@dataclass(frozen=True)
class Share:
    """A worker's share of the batches: every ``of``-th, from ``index`` on."""

    index: int = 0
    of: int = 1


def solve(
    simulation: Simulation,
    presses: int,
    device: str,
    share: Share | None = None,
    settled: Callable[[int, str], None] = lambda number, reason: None,
) -> None:
    """Solve the presses that are missing, and write each batch when it is done.

    Args:
        simulation: The simulation.
        presses: How many presses are wanted in all.
        device: "cpu", or a GPU such as "cuda:0".
        share: The part that this process solves.
        settled: Called with each press's number, and why it was given up or "".

    Raises:
        SolveError: If a specimen's skin cannot be modelled.
    """
    kind, share = device.split(":")[0], share or Share()
    batches = list(simulation.missing(presses, _IN_A_FILE[kind]))[share.index :: share.of]
    # One specimen after the other: a GPU holds the inverse of one skin at a time.
    for specimen in sorted({number for number, _ in batches}):
        model = specimen_model(simulation, specimen, device)
        simulation.check_model(specimen, model.content_hash)
        for number, numbers in batches:
            if number == specimen:
                with _undisturbed(kind):
                    shard = solve_batch(simulation, model, numbers, device, settled)
                shard.write(simulation.folder)
        del model
        _freed(kind)


@contextmanager
def _undisturbed(kind: str) -> Iterator[None]:
    """Collect no garbage inside, on a card: memory that is given back amid a captured graph ends the process."""
    collected = kind == "cuda" and gc.isenabled()
    if collected:
        gc.collect()
        gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()


def _freed(kind: str) -> None:
    """Release GPU memory that torch keeps: the next skin asks the GPU for its free memory."""
    if kind == "cuda":
        import torch

        gc.collect()
        torch.cuda.empty_cache()


def solve_batch(
    simulation: Simulation,
    model: SkinModel,
    numbers: list[int],
    device: str,
    settled: Callable[[int, str], None] = lambda number, reason: None,
) -> Shard:
    """Solve presses of one specimen together.

    Args:
        simulation: Their simulation.
        model: The specimen's skin.
        numbers: The presses.
        device: Device of the model.
        settled: Called with each press's number, and why it was given up or "".
    """
    from tacdata.skin.press import PressRequest

    version, requests = model.content_hash, []
    for number in numbers:
        job = simulation.job(simulation.press(number), version)
        requests.append(
            PressRequest(
                from_document(job.indenter), job.x, job.y, job.yaw, job.depths, tilt_x=job.tilt_x, tilt_y=job.tilt_y
            )
        )
    solutions: dict[int, PathSolution] = {}
    failed: dict[int, str] = {}
    for index, outcome in model.solve_many(requests, min(_AT_A_TIME[device.split(":")[0]], len(requests))):
        number = numbers[index]
        if isinstance(outcome, SolveError):
            failed[number] = outcome.given
        else:
            solutions[number] = outcome
        settled(number, failed.get(number, ""))
    return Shard(solutions, failed, {**model.identity, "model": version})


def specimen_model(simulation: Simulation, specimen: int, device: str) -> SkinModel:
    """Return a specimen's skin on the design's mesh, stretched to its thickness.

    Raises:
        SolveError: If it cannot be modelled.
    """
    from tacdata.skin.mesh.build import MeshSettings, build_mesh
    from tacdata.skin.mesh.coarser import companion_mesh
    from tacdata.skin.model import ModelSettings, SkinModel

    design, specimen_sensor = simulation.sensor, simulation.specimens[specimen]
    settings = ModelSettings(
        mesh=MeshSettings(**simulation.plan.document.get("mesh", {})), error_estimate=simulation.mesh_error
    )
    mesh = build_mesh(design, settings.mesh)
    coarse = companion_mesh(design, settings.mesh, mesh) if simulation.mesh_error else None
    thick = design.skin.thickness, specimen_sensor.skin.thickness
    meshes = [stretched(each, *thick) if each else None for each in (mesh, coarse)]
    return SkinModel(specimen_sensor, settings, device, *meshes)
