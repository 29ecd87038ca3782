"""The finite-element skin model as the farm's solver."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.indenters import from_document
from tacdata.label_farm import environment
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    from tacdata.skin.model import SkinModel
    from tacdata.skin.press import PressRequest
    from tacdata.skin.validity.coarse_press import CoarsePress

_ROUNDS = 2
"""Largest number of solves of a path until its states are close enough; the coarser mesh has predicted where
they are needed."""

_AGAIN = 1.5
"""Factor by which a state must exceed the tolerance for its path to be solved again [1]: its error is that of its
neighbours without it, several times the error with it."""

_AT_A_TIME = {"cpu": 16, "cuda": 512}
"""Presses that a device solves at a time [1] (benchmarks/skin_throughput.py); a CPU reads its factor once for all."""

_DECIDING = tuple(f"tacdata.label_farm.presses.{name}" for name in ("fem", "interpolate", "tolerance"))
"""Files of the farm that decide which states a path gets."""

_SPREADS = "tacdata.skin.derivatives"
"""Decides a path's standard deviations, where the sensor file states spreads."""


class FemModel:
    """The skin model of one sensor, kept by a worker for all its jobs."""

    def __init__(self, sensor: Sensor, alone: bool = False) -> None:
        """Mesh the skin, or take its mesh from the cache; the solver's libraries are loaded for the first press.

        Args:
            sensor: Whose skin.
            alone: Whether each press is solved by itself (`tacdata.skin.model.ModelSettings`).

        Raises:
            SolveError: If the sensor cannot be modelled.
            UsageError: If its file states spreads of unknown parameters.
        """
        from tacdata.indenters.sphere import Sphere
        from tacdata.skin.adhesions import load_adhesion_law
        from tacdata.skin.derivatives.parameter_names import check_spreads
        from tacdata.skin.mesh.build import build_mesh
        from tacdata.skin.mesh.coarser import companion_mesh
        from tacdata.skin.solve.settings import ModelSettings
        from tacdata.skin.validity.stable_strain import StableStrain

        if find_spec("torch") is None:
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
        check_spreads(sensor, Sphere(1.0))
        if sensor.contact.adhesion:
            load_adhesion_law(sensor.contact.adhesion.law)
        self._sensor, self._settings = sensor, ModelSettings(alone=alone)
        self._device = os.environ.get(environment.DEVICE, "cpu")
        self._settings.check(self._device)
        self._mesh = build_mesh(sensor, self._settings.mesh)
        # Refused here, whoever only asks for the version is told so.
        self._mesh.fixed(sensor.contact.bonded, sensor.contact.rim_width)
        self._coarser = companion_mesh(sensor, self._settings.mesh, self._mesh)
        self.remarks = StableStrain(self._mesh, sensor.material).remarks
        """Remarks on this skin for the user."""
        self.batch = 1 if alone else _AT_A_TIME[self._device.split(":")[0]]

    @cached_property
    def _model(self) -> SkinModel:
        from tacdata.skin.model import SkinModel

        return SkinModel(self._sensor, self._settings, self._device, self._mesh, self._coarser)

    @property
    def content_hash(self) -> str:
        """Hash of everything in the model that decides a result, the spreads that its uncertainty comes from too."""
        from tacdata.skin.code_version import model_identity

        spreads = self._sensor.uncertainty
        code = provenance.code_hash(*_DECIDING, *([_SPREADS] if spreads else []))
        identity = model_identity(self._sensor, self._settings, self._mesh, self._coarser)
        return provenance.content_hash([provenance.content_hash(identity), spreads, code])

    def solve(self, job: Job) -> PathSolution:
        """Solve one path, with more states where the job's tolerance needs them.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.
        """
        [(_, outcome)] = self.solve_many([job])
        if isinstance(outcome, SolveError):
            raise outcome
        return outcome

    def solve_many(self, jobs: Sequence[Job]) -> Iterator[tuple[Job, PathSolution | SolveError]]:
        """Solve paths as batches; each is yielded as soon as its states keep the tolerance.

        The coarser mesh, which the error estimate needs anyway, first predicts the necessary states: a path that is
        solved again is solved whole, since friction remembers it.
        """
        requests = [_request(job) for job in jobs]
        coarse = self._model.solve_coarsely(requests, self._together(requests))
        requests = [_foreseen(*each) for each in zip(jobs, requests, coarse, strict=True)]
        open_ones = list(range(len(jobs)))
        for round_ in range(_ROUNDS):
            again = []
            open_requests = [requests[k] for k in open_ones]
            open_coarse = [coarse[k] for k in open_ones]
            for index, solution in self._model.solve_many(open_requests, self._together(open_requests), open_coarse):
                number = open_ones[index]
                job, request = jobs[number], requests[number]
                if isinstance(solution, SolveError):
                    yield job, solution
                    continue
                if job.tolerance is None or round_ == _ROUNDS - 1 or not _far_apart(job.tolerance, solution):
                    yield job, self._finished(job, request, solution, coarse[number])
                else:
                    depths = job.tolerance.refined(solution.depth, solution.surface)
                    requests[number] = replace(request, depths=depths)
                    again.append(number)
            open_ones = again
            if not again:
                return

    def _together(self, requests: Sequence[PressRequest]) -> int:
        return max(1, min(len(requests), self.batch))

    def _finished(
        self, job: Job, request: PressRequest, solution: PathSolution, coarse: CoarsePress | None
    ) -> PathSolution | SolveError:
        from tacdata.skin.derivatives.path_uncertainty import with_uncertainty

        try:
            # Spreads are smooth in depth: the states that were asked for are enough.
            return with_uncertainty(self._model, _request(job), _with_ladder(job, request, solution), coarse)
        except SolveError as error:
            return error


class LoneFemModel(FemModel):
    """The same, whose labels do not depend, to the last bit, on what is labelled with them."""

    def __init__(self, sensor: Sensor) -> None:
        """As `FemModel`."""
        super().__init__(sensor, alone=True)


def _far_apart(tolerance: Tolerance, solution: PathSolution) -> bool:
    return tolerance.exceeded(solution.depth, solution.surface) > _AGAIN


def _foreseen(job: Job, request: PressRequest, coarse: CoarsePress | None) -> PressRequest:
    """Return a request with the states that the coarser mesh asks for."""
    if job.tolerance is None or coarse is None:
        return request
    return replace(request, depths=job.tolerance.foretold(request.depths, coarse.figures.depth, coarse.figures.surface))


def _request(job: Job) -> PressRequest:
    from tacdata.skin.press import PressRequest

    indenter = from_document(job.indenter, f"job {job.key[:12]}")
    return PressRequest(
        indenter=indenter, x=job.x, y=job.y, yaw=job.yaw, depths=job.depths, tilt_x=job.tilt_x, tilt_y=job.tilt_y
    )


def _with_ladder(job: Job, request: PressRequest, solution: PathSolution) -> PathSolution:
    """Say in the solution's provenance how its states were chosen."""
    if job.tolerance is None:
        return solution
    ladder = {
        "asked": len(job.depths),
        "states": len(request.depths),
        "left_out_over_tolerance": round(job.tolerance.exceeded(solution.depth, solution.surface), 3),
    }
    return replace(solution, provenance={**solution.provenance, "ladder": ladder})
