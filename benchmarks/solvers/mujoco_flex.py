"""MuJoCo's flex (PyPI): linear tetrahedra of a St. Venant-Kirchhoff solid, soft contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from solvers.slab_peer import SlabPeer

from tacdata.cases.case import Case


@dataclass(frozen=True)
class MuJoCoFlex(SlabPeer):
    """MuJoCo 4 with its flex elasticity."""

    name = "MuJoCo flex"
    requirement = "mujoco==4.0.*"
    module = "mujoco"
    script = "mujoco_press.py"

    def settings(self, case: Case) -> dict[str, Any]:
        """Time step [s], density [t/mm^3], Rayleigh damping [s], and when a depth counts as settled."""
        return {"time_step": 0.05, "density": 1e-4, "damping": 0.05, "steps": 20, "settled": 1e-4, "limit": 400}
