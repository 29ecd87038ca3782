"""The smooth surface behind a tessellation, against the solids that were tessellated."""

import numpy as np
import pytest
import trimesh

from tacdata.surfaces.nearest import Nearest
from tacdata.surfaces.smooth import smooth


def fine(mesh):
    return smooth(np.asarray(mesh.vertices, float), np.asarray(mesh.faces)).divided(1e-4)


def punch(radius=2.0, fillet=0.3, steps=8, sections=64):
    """A column with a filleted lower edge; coarse as CAD programs write it."""
    angle = np.linspace(0, np.pi / 2, steps + 1)
    line = np.stack([radius - fillet + fillet * np.sin(angle), fillet * (1 - np.cos(angle))], axis=-1)
    return trimesh.creation.revolve(np.array([[0, 0], *line, [radius, 6.0], [0, 6.0]]), sections=sections)


def punch_distance(p, radius=2.0, fillet=0.3):
    u, v = np.hypot(p[:, 0], p[:, 1]) - (radius - fillet), fillet - p[:, 2]
    return np.minimum(np.maximum(u, v), 0) + np.hypot(np.maximum(u, 0), np.maximum(v, 0)) - fillet


@pytest.mark.parametrize(("subdivisions", "facets", "most"), [(2, 71e-3, 5e-3), (3, 18e-3, 1.2e-3), (4, 4.5e-3, 3e-4)])
def test_a_sphere_is_found_again_behind_its_facets(subdivisions, facets, most):
    """Ten times closer than the facets, whatever the tessellation."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=4.0)
    off = np.abs(np.linalg.norm(mesh.triangles_center, axis=1) - 4.0).max()
    assert off == pytest.approx(facets, rel=0.1)
    assert np.abs(np.linalg.norm(fine(mesh)[0], axis=1) - 4.0).max() < most


def test_a_flat_face_beside_a_fillet_stays_flat():
    points, triangles, parent = fine(punch())
    mesh = punch()
    bottom = np.asarray(mesh.face_normals)[:, 2] < -0.9999
    on_bottom = np.unique(triangles[bottom[parent]])
    assert np.abs(points[on_bottom, 2]).max() < 1e-12
    below = points[points[:, 2] < 3]
    assert np.abs(punch_distance(below)).max() < 1e-3


def test_sharp_edges_stay_where_they_are():
    box = trimesh.creation.box(extents=[2, 3, 4])
    points, triangles, _ = fine(box)
    assert np.abs(np.abs(points / [1, 1.5, 2]).max(axis=1) - 1).max() < 1e-12
    assert len(triangles) == len(box.faces)


def test_neighbours_agree_on_the_edge_between_them():
    points, triangles, _ = fine(trimesh.creation.icosphere(subdivisions=2, radius=4.0))
    merged = trimesh.Trimesh(points, triangles, process=True)
    assert merged.is_watertight and merged.is_winding_consistent


def test_places_inside_and_outside_have_their_sign():
    points, triangles, _ = fine(trimesh.creation.icosphere(subdivisions=3, radius=4.0))
    places = np.random.default_rng(5).uniform(-6, 6, (2000, 3))
    found = Nearest(points, triangles).places(places)
    true = np.linalg.norm(places, axis=1) - 4.0
    assert found.distance == pytest.approx(true, abs=2e-3)
    assert np.linalg.norm(found.point - places, axis=1) == pytest.approx(np.abs(found.distance), abs=1e-9)
