"""The mesh against the sensor's own geometry."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from running.user_cache import MESHES
from skin_examples import bumps_sensor, slab_sensor

from tacdata.errors import SolveError
from tacdata.sensor import default_sensor
from tacdata.sensor.sensor import ContactProperties, Skin
from tacdata.skin.contact.contact_surface import face_quadrature
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.build import PINNED, MeshSettings, build_mesh, mesh_key
from tacdata.skin.mesh.coarser import RATIOS, coarser
from tacdata.skin.mesh.generation import make
from tacdata.skin.mesh.generation.make import make_mesh
from tacdata.skin.mesh.generation.surface import surface
from tacdata.skin.mesh.skin_mesh import SkinMesh, quality
from tacdata.skin.model import ModelSettings, SkinModel


def volume(mesh):
    return mesh.shape_gradients()[1].sum()


def area(mesh, faces):
    return face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(faces), 2)[0].sum().item()


def test_a_slab_has_its_volume_and_its_outer_face(slab):
    assert volume(slab.mesh) == pytest.approx(6 * 6 * 2, rel=1e-9)
    assert area(slab.mesh, slab.mesh.outer) == pytest.approx(36, rel=1e-9)
    assert len(slab.mesh.protrusions) == 0


def test_protrusions_add_their_half_spheres(bumps):
    radius, count = 0.7, 4
    half_spheres = count * 2 / 3 * np.pi * radius**3
    assert volume(bumps.mesh) - 50 == pytest.approx(half_spheres, rel=0.02)
    assert volume(bumps.mesh) == pytest.approx(50 + half_spheres, rel=1e-3)
    assert area(bumps.mesh, bumps.mesh.protrusions) == pytest.approx(count * 2 * np.pi * radius**2, rel=0.02)
    assert area(bumps.mesh, bumps.mesh.outer) == pytest.approx(25, rel=1e-9)


def test_every_protrusion_has_faces_under_its_taxel_and_its_tip_on_the_board(bumps):
    mesh, centers = bumps.mesh, bumps.sensor.taxels.centers
    assert np.unique(mesh.protrusion_taxel).tolist() == [0, 1, 2, 3]
    for taxel, center in enumerate(centers):
        nodes = mesh.nodes[np.unique(mesh.protrusions[mesh.protrusion_taxel == taxel])]
        assert np.hypot(*(nodes[:, :2] - center).T).max() < 0.7 + 1e-9
        tip = nodes[nodes[:, 2].argmin()]
        assert tip == pytest.approx([*center, -0.7], abs=0.02)
    assert mesh.nodes[:, 2].min() > -0.7 - 1e-9


def test_surface_normals_look_outward(bumps):
    mesh = bumps.mesh
    for faces in (mesh.outer, mesh.protrusions):
        a, b, c = (mesh.nodes[faces[:, k]] for k in range(3))
        up = np.cross(b - a, c - a)
        inside = [0.0, 0.0, 1.0]
        assert np.einsum("ij,ij->i", up, a - inside).min() > 0 or faces is mesh.protrusions
        if faces is mesh.protrusions:
            centers = np.column_stack([bumps.sensor.taxels.centers[mesh.protrusion_taxel], np.zeros(len(faces))])
            assert np.einsum("ij,ij->i", up, (a + b + c) / 3 - centers).min() > 0


def test_no_element_is_turned_or_flat(slab, bumps):
    for mesh in (slab.mesh, bumps.mesh):
        assert mesh.volumes().min() > 0
        assert mesh.shape_gradients()[1].min() > 0
        assert quality(mesh).worst_ratio > 0.05
        assert quality(mesh).median_ratio > 0.7


def lone_element(corners) -> SkinMesh:
    nodes = np.array([*corners, *((corners[a] + corners[b]) / 2 for a, b in elements.EDGES)])
    empty, none = np.zeros((0, 6), np.int32), np.zeros(10, dtype=bool)
    return SkinMesh(nodes, np.arange(10)[None], empty, empty, np.zeros(0, np.int32), none, none)


def test_a_regular_tetrahedron_has_ratio_one_inside_out_less_and_flat_none():
    corners = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]], dtype=float)
    assert quality(lone_element(corners)).worst_ratio == pytest.approx(1, rel=1e-12)
    assert quality(lone_element(corners[[1, 0, 2, 3]])).worst_ratio == pytest.approx(-1, rel=1e-12)
    assert quality(lone_element(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float))).worst_ratio == 0


@pytest.mark.parametrize("height", [0.0, 1e-12])
def test_an_element_without_volume_is_refused(height):
    """Also where rounding leaves a volume above 0."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, height]], dtype=float)
    with pytest.raises(SolveError, match="element 0 at"):
        lone_element(corners).shape_gradients()


def test_the_named_faces_hold_the_nodes_that_lie_on_them(slab, bumps):
    nodes = slab.mesh.nodes
    assert np.array_equal(slab.mesh.bottom, np.abs(nodes[:, 2]) < 1e-9)
    assert np.array_equal(slab.mesh.sides, np.abs(nodes[:, :2]).max(axis=1) > 3 - 1e-9)
    both = slab.mesh.fixed(("sides", "bottom"))
    assert np.array_equal(both, slab.mesh.sides | slab.mesh.bottom)
    free_tips = bumps.mesh.nodes[:, 2] < -1e-6
    assert not (bumps.mesh.bottom & free_tips).any()


def test_a_mesh_comes_back_from_the_cache_as_it_was(slab, user_cache):
    kept = user_cache / "meshes" / f"{mesh_key(slab.sensor, slab.settings.mesh)}.npz"
    before = kept.stat().st_mtime_ns
    again = build_mesh(slab.sensor, slab.settings.mesh)
    assert again.content_hash == slab.mesh.content_hash
    assert kept.stat().st_mtime_ns == before


@pytest.mark.parametrize("damaged", [lambda b: b"", lambda b: b[:1000], lambda b: b[:300] + bytes(50) + b[350:]])
def test_a_damaged_mesh_in_the_cache_is_made_again(slab, tmp_path, monkeypatch, damaged):
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path))
    path = tmp_path / "meshes" / f"{mesh_key(slab.sensor, slab.settings.mesh)}.npz"
    slab.mesh.save(path)
    path.write_bytes(damaged(path.read_bytes()))
    monkeypatch.setattr(make, "make_mesh", lambda *_: slab.mesh)
    assert build_mesh(slab.sensor, slab.settings.mesh).content_hash == slab.mesh.content_hash
    assert SkinMesh.load(path).content_hash == slab.mesh.content_hash


def test_figures_of_this_room_come_from_meshes_that_are_kept(slab, fine_slab, bumps):
    """A mesh made anew differs at every run, and with it every figure that a test is held to."""
    for model in (slab, fine_slab, bumps):
        assert SkinMesh.load(MESHES / f"{mesh_key(model.sensor, model.settings.mesh)}.npz").content_hash == (
            model.mesh.content_hash
        )


def test_other_settings_give_another_mesh(slab):
    moved = replace(slab.mesh, nodes=slab.mesh.nodes + 1e-9)
    assert moved.content_hash != slab.mesh.content_hash


def test_focus_refines_where_it_is_told_to(slab):
    """In a disc of some eighty faces: fTetWild never makes the same mesh twice, and few faces scatter too much."""
    mesh = build_mesh(slab.sensor, MeshSettings(outer=1.5, interior=1.5, focus=(1.0, 1.0, 1.0, 0.25)))
    corners = mesh.nodes[mesh.outer[:, :3], :2]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    near = np.hypot(*(corners.mean(axis=1) - 1.0).T) < 1.0
    far = np.hypot(*(corners.mean(axis=1) + 1.5).T) < 1.0
    assert np.median(size[near]) < 0.45
    assert np.median(size[far]) > 1.5 * np.median(size[near])


def test_the_surface_given_to_the_mesher_is_closed():
    assert surface(bumps_sensor()).is_watertight


def test_a_skin_whose_faces_collapse_is_refused_with_its_volume(monkeypatch):
    """At the first refusal; that others are tried first stands in test_skin_meshing.py."""
    monkeypatch.setattr(make, "_REFUSALS", 1)
    sensor = replace(slab_sensor(), skin=Skin(6.0, 6.0, 0.05, 0.0))
    with pytest.raises(SolveError, match=r"the skin 1.8 mm\^3") as failure:
        SkinModel(sensor, ModelSettings(mesh=MeshSettings(outer=0.9, interior=1.5)))
    assert "element size" in failure.value.remedy


def test_protrusions_finer_than_their_rings_are_meshed_without_slivers():
    mesh = make_mesh(bumps_sensor(), MeshSettings(outer=0.9, interior=1.2, protrusion=0.35, tip=None))
    assert quality(mesh).worst_ratio > 0.01
    assert np.bincount(mesh.protrusion_taxel).min() > 10
    _, weights = mesh.shape_gradients()
    sensor = bumps_sensor()
    true = sensor.skin.size_x * sensor.skin.size_y * sensor.skin.thickness
    true += sensor.taxels.count * 2 / 3 * np.pi * sensor.skin.protrusion_radius**3
    assert weights.sum() == pytest.approx(true, rel=1e-3)


def test_the_default_mesh_ships_with_the_model():
    key = mesh_key(default_sensor(), MeshSettings())
    beside = {mesh_key(default_sensor(), coarser(MeshSettings(), ratio)) for ratio in RATIOS}
    shipped = {path.stem for path in PINNED.glob("*.npz")}
    assert key in shipped and len(shipped) == 2 and shipped - {key} <= beside
    assert quality(build_mesh(default_sensor(), MeshSettings())).worst_ratio > 0.1


def test_an_inverted_element_is_named_with_its_place(slab):
    tets = slab.mesh.tets.copy()
    tets[17] = tets[17][[1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    with pytest.raises(SolveError, match="element 17 at"):
        replace(slab.mesh, tets=tets).shape_gradients()


def test_nothing_to_hold_the_skin_is_refused(bumps):
    sensor = replace(bumps.sensor, contact=ContactProperties(0.2, (), True))
    with pytest.raises(SolveError, match="no bonded face"):
        SkinModel(sensor, mesh=bumps.mesh)
