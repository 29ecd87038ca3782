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
        edge: Edge length outside the background [mm].
        envelope: How far the surface may move, over its size [1].

    Returns:
        Vertices [mm], shape (v, 3), and tetrahedra, shape (e, 4), int32.

    Raises:
        SolveError: If it cannot.
    """
    points, cells, size = background
    with tempfile.TemporaryDirectory() as scratch:
        request, result = Path(scratch, "asked.npz"), Path(scratch, "made.npz")
        np.savez(
            request, vertices=vertices, faces=faces, points=points, cells=cells, size=size, edge=edge, envelope=envelope
        )
        # With -P no file in the user's working folder can shadow a module of the child.
        line = [sys.executable, "-P", "-m", __name__, str(request), str(result)]
        done = subprocess.run(line, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        if done.returncode or not result.exists():
            message = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
            raise SolveError(
                f"fTetWild gave no mesh of a surface of {len(faces)} triangles: {message}",
                "a closed surface that bounds a solid",
                "check the skin's sizes against one another, or choose another element size",
            )
        with np.load(result) as arrays:
            return arrays["vertices"], arrays["tets"]


def main(request: str, result: str) -> None:
    """Mesh the request of a file into another file."""
    import pytetwild

    os.chdir(Path(result).parent)  # fTetWild leaves a file of its own in the working folder
    with np.load(request) as arrays:
        vertices, tets = pytetwild.tetrahedralize(
            arrays["vertices"],
            arrays["faces"].astype(np.int32),
            edge_length_abs=float(arrays["edge"]),
            epsilon=float(arrays["envelope"]),
            num_threads=1,
            bg_vertices=arrays["points"],
            bg_tets=arrays["cells"],
            bg_values=arrays["size"],
        )
    np.savez(result, vertices=np.asarray(vertices, dtype=float), tets=np.asarray(tets, dtype=np.int32))


if __name__ == "__main__":
    main(*sys.argv[1:])
