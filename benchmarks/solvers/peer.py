"""A peer: one code that can solve a press; one a file of this folder.

`Peer.missing` names the packages to install, `Peer.solve` solves a case in a process of its own and answers
with displacements of the outer face, forces, and their cost. One thread each, so that CPU seconds compare.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from tacdata.cases.case import Case
from tacdata.skin.contact.first_touch import rotation, touch
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.surface.outer_face import OuterFace

ALONE = Path(__file__).parent / "alone"
"""Scripts that run in a process, often an interpreter, of their own."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER")


class PeerError(Exception):
    """A code is missing, cannot solve such a press, or gave up; the message states which."""


@dataclass(frozen=True)
class Answer:
    """A code's solution of a press, at d depths."""

    depth: np.ndarray
    """Depths [mm], shape (d,)."""
    places: np.ndarray
    """Reference positions x, y of the outer face's nodes [mm], shape (n, 2)."""
    triangles: np.ndarray
    """Triangles of the outer face, indices into `places`, shape (f, 3) if linear, (f, 6) if quadratic."""
    displacement: np.ndarray
    """Displacements of the outer face's nodes [mm], shape (d, n, 3)."""
    force: np.ndarray
    """Vertical force on the indenter [N], shape (d,)."""
    protrusion_force: np.ndarray
    """Vertical force on each protrusion [N], shape (d, t); t = 0 without a board."""
    residual: np.ndarray
    """The residual that the code itself gives, shape (d,); NaN if it gives none."""
    seconds: np.ndarray
    """Wall time of each equilibrium [s], shape (d,)."""
    cpu_seconds: np.ndarray
    """CPU time of each equilibrium [s], shape (d,)."""
    setup_cpu_seconds: float
    """CPU time before the first load step: start, reading, factorizing [s]."""
    dofs: int
    """Unknowns [1]."""
    note: str = ""
    """A caveat for the reader, such as "not settled at 1 mm"."""


@dataclass(frozen=True)
class Process:
    """A finished process."""

    output: str
    """Its output."""
    seconds: float
    """Wall time [s]."""
    cpu_seconds: float
    """CPU time [s]."""


@dataclass(frozen=True)
class Peer(ABC):
    """A code that can solve a press."""

    name: ClassVar[str]
    """Shown in tables."""

    @abstractmethod
    def missing(self) -> str | None:
        """Return the packages to install, or None if the code can run."""

    @abstractmethod
    def solve(self, case: Case, mesh: SkinMesh, folder: Path) -> Answer:
        """Solve a case; files go into ``folder``.

        Raises:
            PeerError: If the code cannot solve such a case, or gave up.
        """


def run_alone(command: list[str], folder: Path, limit: float = 3600.0) -> Process:
    """Run a command with one thread in ``folder``, at most ``limit`` seconds.

    Raises:
        PeerError: If it fails or takes too long, with the end of its output.
    """
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{Path(command[0]).name}.log"
    began = time.perf_counter()
    before = os.times()
    with open(log, "w") as out:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=out, stderr=subprocess.STDOUT)
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = f"no end after {limit:g} s"
    after = os.times()
    output = log.read_text(errors="replace")
    if code != 0:
        raise PeerError(f"{Path(command[0]).name} ended with {code}: {' | '.join(output.strip().splitlines()[-4:])}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return Process(output, time.perf_counter() - began, cpu)


def outer_face(mesh: SkinMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of the outer face (indices, ascending) and its triangles in terms of them."""
    nodes, triangles = np.unique(mesh.outer, return_inverse=True)
    return nodes, triangles.reshape(mesh.outer.shape)


def within_reach(case: Case, mesh: SkinMesh) -> np.ndarray:
    """Return which outer triangles the indenter can come near, shape (f,), bool.

    A triangle counts if a node of it is less than 0.3 mm under the indenter at the greatest depth, were the face
    still flat; the face bulges by less than that next to the contact.
    """
    request = case.request
    origin = touch(case.sensor, OuterFace(mesh), request) - [0.0, 0.0, max(request.depths)]
    x, y, z = ((mesh.nodes - origin) @ rotation(request)).T
    return np.any((request.indenter.profile(x, y) < z + 0.3)[mesh.outer], axis=1)


def main_interpreter() -> str:
    """Return the interpreter that runs this process."""
    return sys.executable
