"""Base of the peers from PyPI: a sphere on a slab, a grid of linear tetrahedra, an interpreter of their own."""

from __future__ import annotations

import json
from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.spatial import Delaunay
from solvers.environment import interpreter
from solvers.peer import ALONE, Answer, Peer, PeerError, run_alone

from tacdata.cases.case import Case
from tacdata.skin.mesh.skin_mesh import SkinMesh


@dataclass(frozen=True)
class SlabPeer(Peer):
    """A code that makes its own grid of the slab."""

    requirement: ClassVar[str]
    """The package that pip installs."""
    module: ClassVar[str]
    """The imported module; also the name of its environment."""
    script: ClassVar[str]
    """File in `alone/` that solves the press."""

    peers: Path = Path("peers")
    """Folder of the virtual environments."""
    spacing: float = 1.0
    """Distance of the grid's vertices [mm]."""
    limit: float = 3600.0
    """Longest run [s]."""

    def missing(self) -> str | None:
        """Return how to install it, if it is not there."""
        if interpreter(self.peers, self.module, self.module):
            return None
        return f"run with --install, which puts {self.requirement} into {self.peers / self.module}"

    @abstractmethod
    def settings(self, case: Case) -> dict[str, Any]:
        """Return the script's settings beyond geometry, material and depths."""

    def solve(self, case: Case, mesh: SkinMesh, folder: Path) -> Answer:
        """Hand size, material and sphere to the script."""
        sensor, request = case.sensor, case.request
        if request.indenter.shape != "sphere" or sensor.contact.board or tuple(sensor.contact.bonded) != ("bottom",):
            raise PeerError("only a sphere on a plain slab with its bottom bonded is written for it")
        material, skin = sensor.material, sensor.skin
        press = {
            "size": [skin.size_x, skin.size_y, skin.thickness],
            "spacing": self.spacing,
            "mu": material.shear_modulus,
            "lambda": material.bulk_modulus - 2 * material.shear_modulus / 3,
            "young": material.youngs_modulus,
            "poisson": material.poisson_ratio,
            "radius": request.indenter.parameters[0],
            "tip": [request.x, request.y, skin.thickness],
            "depths": [d for d in request.depths if d > 0],
            "friction": sensor.contact.friction,
            **self.settings(case),
        }
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / "press.json", folder / "result.npz"]
        files[0].write_text(json.dumps(press, indent=1) + "\n")
        python = interpreter(self.peers, self.module, self.module)
        run_alone([str(python), str(ALONE / self.script), *map(str, files)], folder, self.limit)
        with np.load(files[1], allow_pickle=False) as found:
            still = found["moved"] < 1e-4 * found["depth"] + 1e-12
            places, count = found["places"], len(found["depth"])
            return Answer(
                found["depth"],
                places,
                Delaunay(places).simplices,
                found["displacement"],
                found["force"],
                np.zeros((count, 0)),
                np.full(count, np.nan),
                found["seconds"],
                found["cpu_seconds"],
                float(found["setup_cpu_seconds"]),
                int(found["dofs"]),
                "" if still.all() else f"still moving at {', '.join(f'{d:g}' for d in found['depth'][~still])} mm",
            )
