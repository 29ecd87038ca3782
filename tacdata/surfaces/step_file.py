"""Reads solids from STEP files as triangles, by OpenCASCADE (package cascadio)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from tacdata.errors import FormatError
from tacdata.extras import missing_package
from tacdata.paths import StrPath

if TYPE_CHECKING:
    import trimesh

FORMATS = (".step", ".stp")
"""File endings that are read."""

CHORD, TURN = 0.005, 0.2
"""Largest distance of triangles from the solid's faces [mm], and angle between neighbours [rad]."""

_PER_METRE = 1000.0
"""Millimetres in cascadio's output unit, which is always the metre [mm]."""

_DIGITS = 6
"""Decimal places [mm] to which corners of neighbouring faces agree, by single precision."""


def read_step(path: StrPath, what: str) -> trimesh.Trimesh:
    """Return all solids of a file as one surface [mm], with corners of neighbouring faces merged; not checked further.

    Args:
        path: The file.
        what: Use of the file, for errors.

    Raises:
        PackageError: If cascadio is not installed.
        FormatError: If the file cannot be read.
    """
    path = Path(path)
    import trimesh

    try:
        import cascadio
    except ModuleNotFoundError as error:
        instead = f"export the solid as STL from the CAD program (in mm; chord tolerance {CHORD:g} mm or less)"
        raise missing_package(error, f"{what} surface {path.name}: reading STEP", instead) or error from None
    with tempfile.TemporaryDirectory() as scratch:
        converted = Path(scratch) / "solid.glb"
        cascadio.step_to_glb(str(path), str(converted), tol_linear=CHORD, tol_angular=TURN)
        if not converted.is_file():
            raise FormatError(
                f"{what} surface {path.name} cannot be read as STEP",
                "a STEP file (AP203, AP214, AP242) with a solid",
                "export it again",
            )
        mesh = trimesh.load_scene(converted).to_mesh()
    mesh.apply_scale(_PER_METRE)
    mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=_DIGITS)
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh
