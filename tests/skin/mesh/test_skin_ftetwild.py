"""The mesher is a process of its own: what it does to its process is done to no other."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tacdata.errors import SolveError
from tacdata.skin.mesh.generation.ftetwild import ftetwild

ROOT = Path(__file__).parents[3]
BOX = trimesh.creation.box()
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
CELLS = np.array([[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]], dtype=np.int32)
BACKGROUND = CUBE, CELLS, np.full(8, 0.4)
INTERRUPTED = """
import os, signal, time
import numpy as np
from test_skin_ftetwild import cube
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it for what runs in the background
vertices, tets = cube()
np.savez("made.npz", vertices=vertices, tets=tets)
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)
except KeyboardInterrupt:
    print("files are closed")
"""


def cube():
    return ftetwild(BOX.vertices, BOX.faces, BACKGROUND, 0.4, 1e-3)


@pytest.fixture(scope="module")
def meshed(tmp_path_factory):
    """What a process said that meshed the cube and was then interrupted, and the folder where it worked."""
    folder = tmp_path_factory.mktemp("user")
    path = os.pathsep.join([os.path.dirname(__file__), str(ROOT)])
    return folder, subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_cube_is_filled(meshed):
    folder, _ = meshed
    assert [path.name for path in folder.iterdir()] == ["made.npz"], "files of the mesher's own stay out of the folder"
    with np.load(folder / "made.npz") as made:
        vertices, tets = made["vertices"], made["tets"]
    edges = vertices[tets[:, 1:]] - vertices[tets[:, :1]]
    assert np.abs(np.linalg.det(edges)).sum() / 6 == pytest.approx(1.0, rel=2e-2)


def test_ctrl_c_still_closes_files_after_a_skin_was_meshed(meshed):
    """fTetWild sets SIGINT to its default: a process that had loaded it died at once, with files open."""
    _, done = meshed
    assert (done.returncode, done.stdout.strip()) == (0, "files are closed"), done.stderr


def test_a_mesher_that_fails_is_told():
    with pytest.raises(SolveError, match="fTetWild gave no mesh of a surface of 0 triangles"):
        ftetwild(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32), BACKGROUND, 0.4, 1e-3)
