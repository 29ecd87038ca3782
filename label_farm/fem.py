"""The FEM skin as the farm's model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from label_farm.job import Job
from tacdata import provenance
from tacdata.indenters import from_document
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    from tacdata.skin.press import PressRequest

_ROUNDS = 3
"""How often a path is solved at most until its states are near enough to each other."""

_SOURCES = ("fem.py", "interpolate.py", "tolerance.py")
"""Files of the farm that decide which states a path gets."""


class FemModel:
    """One skin model, kept by a worker for all jobs of its sensor."""

    def __init__(self, sensor: Sensor) -> None:
        """Mesh the skin, or take its mesh from the cache; costs seconds.

        Raises:
            SolveError: If the sensor cannot be modelled.
            UsageError: If its file states spreads of what the model does not know.
        """
        from tacdata.indenters.sphere import Sphere
        from tacdata.skin.model import SkinModel
        from tacdata.skin.path_uncertainty import check_spreads

        check_spreads(sensor, Sphere(1.0))
        self._model = SkinModel(sensor)

    @property
    def remarks(self) -> tuple[str, ...]:
        """In words, what a user should know of this skin."""
        return self._model.remarks

    @property
    def content_hash(self) -> str:
        """Hash of everything in the model that decides a result, the spreads that its uncertainty comes from too."""
        here = Path(__file__).parent
        sources = [provenance.file_hash(here / name) for name in _SOURCES]
        return provenance.content_hash([self._model.content_hash, self._model.sensor.uncertainty, sources])

    def solve(self, job: Job) -> PathSolution:
        """Solve one path, with states added where the job's tolerance asks for them.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.
        """
        from tacdata.skin.path_uncertainty import with_uncertainty
        from tacdata.skin.press import PressRequest

        indenter = from_document(job.indenter, f"job {job.key[:12]}")
        request = PressRequest(indenter=indenter, x=job.x, y=job.y, yaw=job.yaw, depths=job.depths)
        request, solution = self._resolved(request, job)
        return with_uncertainty(self._model, request, solution)

    def _resolved(self, request: PressRequest, job: Job) -> tuple[PressRequest, PathSolution]:
        """Solve a path and, as long as states are missing, solve it again with them: friction remembers the path."""
        tolerance = job.tolerance
        solution = self._model.solve(request)
        if tolerance is None:
            return request, solution
        for _ in range(_ROUNDS - 1):
            depths = tolerance.refined(solution.depth, solution.surface)
            if depths == request.depths:
                break
            request = replace(request, depths=depths)
            solution = self._model.solve(request)
        ladder = {
            "asked": len(job.depths),
            "states": len(request.depths),
            "left_out_over_tolerance": round(tolerance.exceeded(solution.depth, solution.surface), 3),
        }
        return request, replace(solution, provenance={**solution.provenance, "ladder": ladder})
