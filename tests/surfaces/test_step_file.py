"""STEP files as surfaces; the file is written here, a box of flat faces, so that no CAD kernel is needed to test."""

import sys

import numpy as np
import pytest

from tacdata.errors import FormatError, PackageError
from tacdata.surfaces.closed import read_closed

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('box','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""


def box_in_step(size, unit):
    """A box from the origin, sizes in ``unit``: SI_UNIT's prefix, such as ``.MILLI.`` or ``$`` for metres."""
    lines: list[str] = []

    def add(text):
        lines.append(f"#{len(lines) + 1}={text};")
        return f"#{len(lines)}"

    def point(p):
        return add(f"CARTESIAN_POINT('',({','.join(f'{float(v)!r}' for v in p)}))")

    def direction(d):
        return add(f"DIRECTION('',({','.join(f'{float(v)!r}' for v in d)}))")

    corners = {k: np.array([k & 1, k >> 1 & 1, k >> 2 & 1]) * size for k in range(8)}
    vertices = {k: add(f"VERTEX_POINT('',{point(p)})") for k, p in corners.items()}
    edges: dict[tuple[int, int], str] = {}

    def edge(a, b):
        if (b, a) in edges:
            return edges[b, a], ".F."
        if (a, b) not in edges:
            way = corners[b] - corners[a]
            vector = add(f"VECTOR('',{direction(way / np.linalg.norm(way))},1.)")
            line = add(f"LINE('',{point(corners[a])},{vector})")
            edges[a, b] = add(f"EDGE_CURVE('',{vertices[a]},{vertices[b]},{line},.T.)")
        return edges[a, b], ".T."

    faces = []
    for loop in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
        around = zip(loop, (*loop[1:], loop[0]), strict=True)
        oriented = [add("ORIENTED_EDGE('',*,*,{},{})".format(*edge(a, b))) for a, b in around]
        bound = add(f"FACE_OUTER_BOUND('',{add(f"EDGE_LOOP('',({','.join(oriented)}))")},.T.)")
        a, b, c = (corners[k] for k in loop[:3])
        normal, along = np.cross(b - a, c - b), b - a
        axes = direction(normal / np.linalg.norm(normal)), direction(along / np.linalg.norm(along))
        plane = add(f"PLANE('',{add(f"AXIS2_PLACEMENT_3D('',{point(a)},{axes[0]},{axes[1]})")})")
        faces.append(add(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
    solid = add(f"MANIFOLD_SOLID_BREP('',{add(f"CLOSED_SHELL('',({','.join(faces)}))")})")
    units = [
        add(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({unit},.METRE.))"),
        add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))"),
        add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())"),
    ]
    accuracy = add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),{units[0]},'','')")
    context = add(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({accuracy}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({','.join(units)}))REPRESENTATION_CONTEXT('',''))"
    )
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({solid}),{context})")
    application = add("APPLICATION_CONTEXT('')")
    product = add(f"PRODUCT('box','box','',({add(f"PRODUCT_CONTEXT('',{application},'mechanical')")}))")
    formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    definition = add(
        f"PRODUCT_DEFINITION('','',{formation},{add(f"PRODUCT_DEFINITION_CONTEXT('',{application},'design')")})"
    )
    add(f"SHAPE_DEFINITION_REPRESENTATION({add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")},{shape})")
    return HEAD + "\n".join(lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"


@pytest.mark.parametrize(("size", "unit"), [((8.0, 6.0, 3.3), ".MILLI."), ((0.008, 0.006, 0.0033), "$")])
def test_a_solid_is_read_in_millimetres_whatever_its_file_states(tmp_path, size, unit):
    pytest.importorskip("cascadio")
    (tmp_path / "box.step").write_text(box_in_step(np.array(size), unit))
    mesh = read_closed(tmp_path / "box.step", 1.0, "skin")
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [8.0, 6.0, 3.3]], atol=2e-6)
    assert mesh.is_watertight and mesh.volume == pytest.approx(8.0 * 6.0 * 3.3, rel=1e-6)


def test_what_is_no_step_file_is_refused(tmp_path):
    pytest.importorskip("cascadio")
    (tmp_path / "text.stp").write_text("hello")
    with pytest.raises(FormatError, match=r"text\.stp cannot be read as STEP"):
        read_closed(tmp_path / "text.stp", 1.0, "skin")


def test_without_the_package_the_error_names_it(tmp_path, monkeypatch):
    (tmp_path / "box.step").write_text("")
    monkeypatch.setitem(sys.modules, "cascadio", None)
    with pytest.raises(PackageError, match=r"\[step\].* or export the solid as STL"):
        read_closed(tmp_path / "box.step", 1.0, "skin")
