"""Reads a closed surface from an STL, OBJ, PLY or STEP file; refuses it, with the place, if it bounds no solid."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.paths import StrPath
from tacdata.surfaces import step_file

if TYPE_CHECKING:
    import trimesh

FORMATS = (".stl", ".obj", ".ply", *step_file.FORMATS)
"""File endings that are read."""

_CAD = (".iges", ".igs", ".brep", ".3mf", ".sldprt", ".f3d")

_FEWEST = 1e-9
"""Volume over that of the bounding box below which a surface counts as flat [1]."""


def read_closed(path: StrPath, scale: float, what: str) -> trimesh.Trimesh:
    """Return the surface in a file, in mm, after checking that it bounds a solid.

    Args:
        path: The file.
        scale: Millimetres in the file's unit (1 for mm, 1000 for m, 25.4 for inches); 1 for a STEP file, which states
            its own unit.
        what: Use of the file, for errors ("indenter", "skin").

    Raises:
        UsageError: If there is no such file, or its format is not read.
        FormatError: If it is damaged, or its surface is open, inside out, flat or self-intersecting, with the place.

    Example:
        >>> from tacdata.indenters.mesh import SHAPES
        >>> from tacdata.surfaces.closed import read_closed
        >>> surface = read_closed(SHAPES / "fingertip.stl", scale=1.0, what="indenter")
        >>> surface.is_watertight
        True
    """
    path = Path(path)
    import trimesh

    _check_name(path, what)
    try:
        if path.suffix.lower() in step_file.FORMATS:
            mesh = step_file.read_step(path, what)
        else:
            mesh = trimesh.load_mesh(path, file_type=path.suffix[1:].lower(), process=True)
    except TacdataError:
        raise
    except Exception as error:  # trimesh's readers raise any of their parsers' errors
        raise FormatError(
            f"{what} surface {path.name} cannot be read: {error or type(error).__name__}",
            f"a {path.suffix[1:].upper()} file of triangles",
            "export it again",
        ) from None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise FormatError(
            f"{what} surface {path.name} holds no triangles", "a surface of triangles", "export it as one solid"
        )
    if not np.isfinite(mesh.vertices).all():
        raise FormatError(
            f"{what} surface {path.name} holds coordinates that are no numbers", "finite coordinates", "export it again"
        )
    mesh.apply_scale(scale)
    check_closed(mesh, f"{what} surface {path.name}")
    return mesh


def _check_name(path: Path, what: str) -> None:
    if path.suffix.lower() in _CAD:
        raise UsageError(
            f"{what} surface {path.name}: {path.suffix[1:].upper()} files are not read",
            ", ".join(FORMATS),
            "export the solid as STL from the CAD program (in mm; chord tolerance 0.005 mm or less), or with FreeCAD's "
            "Mesh workbench or gmsh -2 -format stl",
        )
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"{what} surface {path.name}", f"a file ending in {', '.join(FORMATS)}", "export it as STL")
    if not path.is_file():
        raise UsageError(f"no file {path}", f"an {', '.join(FORMATS)} file of the {what}", "check the path")


def check_closed(mesh: trimesh.Trimesh, name: str) -> None:
    """Refuse a surface [mm] that bounds no solid; ``name`` names it in errors.

    Raises:
        FormatError: With the place of the fault.
    """
    from tacdata.surfaces.crossings import crossing_faces

    _check_edges(mesh, name)
    box = float(np.prod(mesh.extents))
    if abs(mesh.volume) <= _FEWEST * box or not box:
        raise FormatError(
            f"{name} encloses {mesh.volume:.3g} mm^3", "a solid with volume", "export the solid, not a sheet"
        )
    if not mesh.is_winding_consistent or mesh.volume < 0:
        raise FormatError(
            f"{name} is inside out{'' if mesh.is_winding_consistent else ' in parts'}: volume {mesh.volume:.4g} mm^3",
            "triangles counter-clockwise seen from outside",
            "flip the normals in the CAD program or MeshLab",
        )
    pairs = crossing_faces(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces))
    if len(pairs):
        place = np.asarray(mesh.triangles_center)[pairs[0]].mean(axis=0)
        raise FormatError(
            f"{name} runs through itself: {len(pairs)} triangles cross others, the first near {_place(place)}",
            "a surface that meets itself nowhere",
            "unite the bodies in the CAD program (boolean union), or repair it in MeshLab",
        )


def _check_edges(mesh: trimesh.Trimesh, name: str) -> None:
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    for wrong, words in ((count == 1, "open edges"), (count > 2, "edges shared by more than two triangles")):
        if wrong.any():
            place = np.asarray(mesh.vertices)[edges[wrong][0]].mean(axis=0)
            raise FormatError(
                f"{name} is not watertight: {wrong.sum()} {words}, the first near {_place(place)}",
                "every edge shared by exactly two triangles",
                "export the whole solid, or close it (MeshLab: Close Holes; Blender: 3D-Print toolbox)",
            )


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in point) + ") mm"
