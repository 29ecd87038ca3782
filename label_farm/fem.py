"""The FEM skin as the farm's model."""

from __future__ import annotations

from label_farm.job import Job
from tacdata.indenters import from_document
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor


class FemModel:
    """One skin model, kept by a worker for all jobs of its sensor."""

    def __init__(self, sensor: Sensor) -> None:
        """Mesh the skin, or take its mesh from the cache; costs seconds.

        Raises:
            SolveError: If the sensor cannot be modelled.
        """
        from tacdata.skin.model import SkinModel

        self._model = SkinModel(sensor)

    @property
    def remarks(self) -> tuple[str, ...]:
        """In words, what a user should know of this skin."""
        return self._model.remarks

    @property
    def content_hash(self) -> str:
        """Hash of everything in the model that decides a result."""
        return self._model.content_hash

    def solve(self, job: Job) -> PathSolution:
        """Solve one path.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.
        """
        from tacdata.skin.press import PressRequest

        indenter = from_document(job.indenter, f"job {job.key[:12]}")
        return self._model.solve(
            PressRequest(indenter=indenter, x=job.x, y=job.y, yaw=job.yaw, depths=job.depths)
        )
