"""fTetWild (Hu et al. 2020) in its own process: python -m tacdata.skin.mesh.generation.ftetwild ASKED.npz MADE.npz.

It takes Ctrl-C from whoever loads it (the process then dies at once, with files open), writes files of its own into the
working folder, and cannot be interrupted.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tacdata.errors import SolveError


def ftetwild(
    vertices: np.ndarray,
    faces: np.ndarray,
    background: tuple[np.ndarray, np.ndarray, np.ndarray],
    edge: float,
    envelope: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Fill a closed surface with tetrahedra.

    Args:
        vertices: Of the surface [mm], shape (n, 3).
        faces: Its triangles, shape (f, 3).
        background: Points [mm], shape (p, 3), tetrahedra, shape (q, 4), and edge length at the points [mm], shape (p,).
        edge: Edge length where the background says nothing [mm].
        envelope: How far the surface may move, over its size [1].

    Returns:
        Vertices [mm], shape (v, 3), and tetrahedra, shape (e, 4), int32.

    Raises:
        SolveError: If it cannot.
    """
    points, cells, size = background
    with tempfile.TemporaryDirectory() as scratch:
        asked, made = Path(scratch, "asked.npz"), Path(scratch, "made.npz")
        np.savez(
            asked, vertices=vertices, faces=faces, points=points, cells=cells, size=size, edge=edge, envelope=envelope
        )
        line = [sys.executable, "-P", "-m", __name__, str(asked), str(made)]
        done = subprocess.run(line, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        if done.returncode or not made.exists():
            said = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
            raise SolveError(
                f"fTetWild gave no mesh of a surface of {len(faces)} triangles: {said}",
                "a closed surface that bounds a solid",
                "check the skin's sizes against one another, or choose another element size",
            )
        with np.load(made) as found:
            return found["vertices"], found["tets"]


def main(asked: str, made: str) -> None:
    """Mesh what one file asks for into another."""
    import pytetwild

    os.chdir(Path(made).parent)  # fTetWild leaves a file of its own in the working folder
    with np.load(asked) as given:
        vertices, tets = pytetwild.tetrahedralize(
            given["vertices"],
            given["faces"].astype(np.int32),
            edge_length_abs=float(given["edge"]),
            epsilon=float(given["envelope"]),
            num_threads=1,
            bg_vertices=given["points"],
            bg_tets=given["cells"],
            bg_values=given["size"],
        )
    np.savez(made, vertices=np.asarray(vertices, dtype=float), tets=np.asarray(tets, dtype=np.int32))


if __name__ == "__main__":
    main(*sys.argv[1:])
