"""GetFEM (Debian): the same mesh, the same law, the indenter as a formula, Coulomb friction by augmented Lagrangian."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from solvers import gwfl
from solvers.peer import ALONE, Answer, Peer, PeerError, outer_face, run_alone, within_reach

from tacdata.cases.case import Case
from tacdata.skin.contact.first_touch import rotation, touch
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.outer_face import OuterFace

PYTHON = "/usr/bin/python3"

HATS = "FEM_STRUCTURED_COMPOSITE(FEM_PK(3,1),2)"
"""Finite element whose trace on a face is piecewise linear on its four sub-triangles."""
ON_HATS = "IM_STRUCTURED_COMPOSITE(IM_TETRAHEDRON(5),2)"
"""Quadrature on the same sub-triangles, 7 points of degree 5 on each."""


@dataclass(frozen=True)
class GetFEM(Peer):
    """Debian's GetFEM in Debian's Python."""

    name = "GetFEM"
    contact: str = "lagrangian"
    """"lagrangian". Or, without friction, "active set": multipliers at nodes that close mean gaps or are 0."""
    multiplier: str = "FEM_PK(3,2)"
    """Finite element of the multipliers; only their traces on the contact faces count."""
    augmentation: float = 10.0
    """Augmentation of the Lagrangian over Young's modulus [1/mm]."""
    volume_rule: str = "IM_TETRAHEDRON(2)"
    """Quadrature of the body, 4 points of degree 2; IM_TETRAHEDRON(5) has 15 points and takes 1.4 times as long."""
    surface_rule: str = "IM_TETRAHEDRON(5)"
    """Quadrature of the contact: on the faces, 7 points of degree 5."""
    board_rule: str = ON_HATS
    """Quadrature of the contact with the board: the same on 4 sub-triangles."""
    step: float = 0.25
    """Longest load step [mm]."""
    hydro: str = ""
    """Finite element of a pressure of its own (mixed form, which does not lock), such as "FEM_PK(3,1)", Taylor and
    Hood's; empty for displacements alone."""
    residual: float = 1e-9
    """Largest out-of-balance nodal force [N] at which Newton's method stops."""
    limit: float = 3600.0
    """Longest run [s]."""

    def missing(self) -> str | None:
        """Return how to install it, if it is not there."""
        there = (
            Path(PYTHON).exists()
            and not subprocess.run([PYTHON, "-c", "import getfem, numpy"], capture_output=True, check=False).returncode
        )
        return None if there else "apt-get install python3-getfem++ (Debian, Ubuntu)"

    def solve(self, case: Case, mesh: SkinMesh, folder: Path) -> Answer:
        """Hand mesh, law and shape to `getfem_press.py`."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / name for name in ("mesh.npz", "press.json", "result.npz")]
        near = within_reach(case, mesh)
        np.savez(
            files[0],
            nodes=mesh.nodes,
            tets=mesh.tets,
            outer=mesh.outer[near],
            protrusions=mesh.protrusions,
            taxel=mesh.protrusion_taxel,
            fixed=mesh.fixed(case.sensor.contact.bonded),
        )
        files[1].write_text(json.dumps(self._press(case, mesh), indent=1) + "\n")
        run_alone([PYTHON, str(ALONE / "getfem_press.py"), *map(str, files)], folder, self.limit)
        with np.load(files[2], allow_pickle=False) as found:
            top, triangles = outer_face(mesh)
            return Answer(
                found["depth"],
                mesh.nodes[top, :2],
                triangles,
                found["displacement"][:, top],
                found["force"][:, 2],
                found["protrusion_force"],
                found["residual"],
                found["seconds"],
                found["cpu_seconds"],
                float(found["setup_cpu_seconds"]),
                int(found["dofs"]),
            )

    def _press(self, case: Case, mesh: SkinMesh) -> dict:
        sensor, request = case.sensor, case.request
        laws = gwfl.MIXED_LAWS if self.hydro else gwfl.LAWS
        law, shape = laws.get(sensor.material.law), gwfl.shape(request.indenter)
        if law is None or shape is None:
            what = f"law {sensor.material.law}" if law is None else f"shape {request.indenter.shape}"
            raise PeerError(f"{what} is not written in GWFL (benchmarks/solvers/gwfl.py)")
        modulus = sensor.material.youngs_modulus
        if self.contact != "lagrangian" and sensor.contact.friction:
            raise PeerError(f"{self.contact} is written without friction: contact=lagrangian has it")
        numbers = {
            "r": self.augmentation * modulus,
            "r_t": self.augmentation * modulus,
            "friction": sensor.contact.friction,
        }
        return {
            "law": law,
            "hydro": self.hydro,
            "constants": {**gwfl.constants(sensor.material), **numbers},
            "shape": shape[0],
            "edge": shape[1],
            "tip": touch(sensor, OuterFace(mesh), request).tolist(),
            "turn": rotation(request).tolist(),
            "depths": [d for d in request.depths if d > 0],
            "step": self.step,
            "friction": sensor.contact.friction,
            "board": -sensor.skin.protrusion_tip if sensor.contact.board else None,
            "contact": self.contact,
            "volume_rule": self.volume_rule,
            "surface_rule": self.surface_rule,
            "board_rule": self.board_rule,
            "multiplier": self.multiplier,
            "residual": self.residual,
            "max_newton": 60,
        }


def with_nodal_contact(**settings: Any) -> GetFEM:
    """Return GetFEM with contact discretized as ours: the same hats, mean gaps and active set."""
    return GetFEM(contact="active set", multiplier=HATS, surface_rule=ON_HATS, **settings)
