"""Newton's vertex block descent (PyPI): linear tetrahedra, contact at vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from solvers.slab_peer import SlabPeer

from tacdata.cases.case import Case


@dataclass(frozen=True)
class NewtonVBD(SlabPeer):
    """Newton's SolverVBD on the CPU."""

    name = "Newton VBD"
    requirement = "newton==1.8.*"
    module = "newton"
    script = "newton_press.py"
    iterations: int = 20
    """Sweeps over all vertices in a step."""
    steps: int = 20
    """Steps a depth: half of them move the sphere, half let the skin settle."""

    def settings(self, case: Case) -> dict[str, Any]:
        """Penalty [N/mm] at vertices, sweeps and steps."""
        return {"penalty": 20.0, "iterations": self.iterations, "steps": self.steps, "time_step": 0.01}
