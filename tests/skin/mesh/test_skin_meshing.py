"""Skins of other shapes: low and high protrusions, bent pads, held rims, surfaces from files."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
import yaml
from skin_examples import box_mesh, bumps_sensor, slab_sensor

from tacdata.errors import FormatError, SolveError, UsageError
from tacdata.sensor import Sensor, Skin, read_sensor
from tacdata.skin.mesh.build import MeshSettings, mesh_key
from tacdata.skin.mesh.generation import make
from tacdata.skin.mesh.generation.make import make_mesh
from tacdata.skin.mesh.generation.protrusion import Protrusion
from tacdata.skin.mesh.generation.true_volume import true_volume, volume_error
from tacdata.skin.mesh.skin_mesh import quality

COARSE = MeshSettings(outer=0.9, interior=1.5, protrusion=1.0, tip=None)


def skin_of(sensor, **changes):
    return replace(sensor, skin=replace(sensor.skin, **changes))


@pytest.mark.parametrize(
    ("radius", "height", "volume"),
    [
        (0.7, 0.7, 2 / 3 * np.pi * 0.343),
        (0.7, 1.2, 2 / 3 * np.pi * 0.343 + np.pi * 0.49 * 0.5),
        (0.7, 0.3, np.pi * 0.3 * (3 * 0.49 + 0.09) / 6),
    ],
)
def test_a_protrusion_has_the_volume_and_the_surface_of_its_kind(radius, height, volume):
    shape = Protrusion(radius, height)
    assert shape.volume == pytest.approx(volume, rel=1e-12)
    angle = np.linspace(0, 2 * np.pi, 7)
    foot = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
    assert shape.away(foot) == pytest.approx(np.zeros(7), abs=1e-12)
    assert shape.away(np.array([[0.0, 0.0, -height]])) == pytest.approx([0.0], abs=1e-12)
    around = np.random.default_rng(1).uniform([-0.6, -0.6, -height], [0.6, 0.6, -0.05], (50, 3))
    assert np.abs(shape.away(shape.project(around))).max() < 1e-12


@pytest.mark.parametrize("height", [0.3, 1.2])
def test_low_and_high_protrusions_are_meshed_on_their_true_faces(height):
    sensor = skin_of(bumps_sensor(), protrusion_height=height)
    mesh = make_mesh(sensor, COARSE)
    assert mesh.nodes[:, 2].min() == pytest.approx(-height, abs=1e-9)
    assert abs(volume_error(sensor, mesh)) < 2e-3
    assert quality(mesh).worst_ratio > 0.05
    corners = np.unique(mesh.protrusions[:, :3])
    offset = mesh.nodes[corners, None, :2] - sensor.taxels.centers[None]
    nearest = np.hypot(*np.moveaxis(offset, -1, 0)).argmin(axis=1)
    local = np.column_stack([offset[np.arange(len(corners)), nearest], mesh.nodes[corners, 2]])
    assert np.abs(Protrusion.of(sensor.skin).away(local)).max() < 1e-9
    assert np.bincount(mesh.protrusion_taxel).min() >= 10


@pytest.mark.parametrize(
    ("radii", "underside"),
    [((12.0, 0.0), "bent"), ((12.0, 12.0), "bent"), ((14.0, 10.0), "flat"), ((0.0, 8.0), "flat")],
)
def test_a_bent_pad_has_its_outer_face_and_its_volume(radii, underside):
    sensor = skin_of(slab_sensor(), curvature_radius_x=radii[0], curvature_radius_y=radii[1], underside=underside)
    mesh = box_mesh(sensor, 5, 5, 3)
    outer = mesh.nodes[np.unique(mesh.outer)]
    assert outer[:, 2] == pytest.approx(sensor.skin.outer_height(*outer[:, :2].T), abs=1e-12)
    assert np.abs(outer[:, :2]).max() == pytest.approx(3.0)
    assert volume_error(sensor, mesh) == pytest.approx(0, abs=1e-4)
    assert mesh.shape_gradients()[1].min() > 0
    if underside == "flat":
        assert mesh.nodes[mesh.bottom, 2] == pytest.approx(np.zeros(mesh.bottom.sum()), abs=1e-12)


def test_a_spherical_pad_of_even_thickness_is_a_shell():
    sensor = skin_of(slab_sensor(), curvature_radius_x=10.0, curvature_radius_y=10.0)
    mesh = box_mesh(sensor, 4, 4, 2)
    reach = np.linalg.norm(mesh.nodes - [0, 0, 2.0 - 10.0], axis=1)
    assert reach[np.unique(mesh.outer)] == pytest.approx(10.0 * np.ones(len(np.unique(mesh.outer))))
    assert reach[mesh.bottom] == pytest.approx(8.0 * np.ones(mesh.bottom.sum()))


def test_a_flat_pad_has_the_key_of_a_file_that_says_nothing_of_bending():
    sensor = bumps_sensor()
    assert sensor.skin.document == {"size_x": 5.0, "size_y": 5.0, "thickness": 2.0, "protrusion_radius": 0.7}
    assert mesh_key(skin_of(sensor, protrusion_height=0.5), COARSE) != mesh_key(sensor, COARSE)


def test_a_held_rim_is_the_border_of_the_underside():
    mesh = box_mesh(slab_sensor(), 6, 6, 2)
    held = mesh.fixed(("rim",), 1.0)
    x, y, z = mesh.nodes.T
    border = np.maximum(np.abs(x), np.abs(y)) >= 2.0 - 1e-9
    assert np.array_equal(held, border & (np.abs(z) < 1e-9))
    assert np.array_equal(mesh.fixed(("rim", "sides"), 1.0), held | mesh.sides)


def document(**skin):
    sensor = slab_sensor(size=5.0, bonded=("bottom",))
    values = {**sensor.document, "assumptions": {}}
    values.pop("transduction", None)
    values["skin"] = {"size_x": 5.0, "size_y": 5.0, "thickness": 2.0, **skin}
    return values


def written(folder, values, **surfaces):
    for name, mesh in surfaces.items():
        mesh.export(folder / f"{name}.stl")
    path = folder / "sensor.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


def dome():
    """A 5 x 5 mm pad under a sphere of 12 mm radius, 2 mm high."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=12.0)
    ball.apply_translation([0, 0, -10])
    block = trimesh.creation.box(bounds=[[-2.5, -2.5, 0], [2.5, 2.5, 3]])
    return trimesh.boolean.intersection([block, ball], engine="manifold")


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The dome as a sensor's own surface, and its mesh."""
    sensor = read_sensor(written(tmp_path_factory.mktemp("own"), document(surface={"file": "dome.stl"}), dome=dome()))
    return sensor, make_mesh(sensor, MeshSettings(outer=0.7, interior=1.2))


def test_a_surface_from_a_file_is_meshed_on_the_smooth_surface_behind_its_facets(own):
    """Facets of 0.4 mm lie up to 2 um below a sphere of 12 mm, those of the mesh 10; nodes come closer."""
    sensor, mesh = own
    outer = mesh.nodes[np.unique(mesh.outer)]
    off = np.linalg.norm(outer - [0, 0, -10.0], axis=1) - 12.0
    assert np.sqrt((off**2).mean()) < 1.5e-3 and np.abs(off).max() < 0.02
    assert abs(volume_error(sensor, mesh)) < 1e-3
    assert quality(mesh).worst_ratio > 0.05
    assert mesh.nodes[mesh.bottom, 2] == pytest.approx(np.zeros(mesh.bottom.sum()), abs=1e-6)
    assert np.abs(np.abs(mesh.nodes[mesh.sides][:, :2]).max(axis=1) - 2.5).max() < 1e-6, "sharp edges stay sharp"
    assert len(mesh.protrusions) == 0


def test_a_surface_is_named_by_its_content_wherever_it_lies(own):
    sensor, _ = own
    values = sensor.document
    assert values["skin"]["surface"]["file"] == "dome.stl" and len(values["skin"]["surface"]["sha256"]) == 64
    again = Sensor.from_document(values, "recording")
    assert again == sensor
    renamed = Sensor.from_document(
        {**values, "skin": {**values["skin"], "surface": {**values["skin"]["surface"], "file": "other.stl"}}}, "other"
    )
    assert renamed.content_hash == sensor.content_hash
    assert mesh_key(renamed, COARSE) == mesh_key(sensor, COARSE)


def test_protrusions_of_a_surface_from_a_file_belong_to_their_taxels(tmp_path):
    parts = [trimesh.creation.box(bounds=[[-2.5, -2.5, 0], [2.5, 2.5, 2]])]
    for x in (-1.0, 1.0):
        parts.append(trimesh.creation.icosphere(subdivisions=2, radius=0.7))
        parts[-1].apply_translation([x, 0, 0])
    values = document(protrusion_radius=0.7, surface={"file": "two.stl", "protrusions": [{"high": [9, 9, -0.05]}]})
    values["taxels"] = {"columns": 2, "rows": 1, "pitch_x": 2.0, "pitch_y": 1.0}
    values["contact"] = {"friction": 0.2, "bonded": ["sides"], "board": True}
    sensor = read_sensor(written(tmp_path, values, two=trimesh.boolean.union(parts, engine="manifold")))
    mesh = make_mesh(sensor, COARSE)
    middle = mesh.nodes[mesh.protrusions[:, :3], 0].mean(axis=1)
    assert set(mesh.protrusion_taxel) == {0, 1}
    assert np.array_equal(mesh.protrusion_taxel, (middle > 0).astype(int))
    assert mesh.nodes[mesh.protrusions][:, :, 2].max() < 0.01
    assert true_volume(sensor) == pytest.approx(50 + 4 / 3 * np.pi * 0.343, rel=5e-3)


def test_rules_that_choose_no_face_are_refused(tmp_path):
    rules = {"file": "dome.stl", "outer": [{"normal": [0, 0, 1], "low": [0, 0, 5]}]}
    sensor = read_sensor(written(tmp_path, document(surface=rules), dome=dome()))
    with pytest.raises(SolveError, match="chosen as outer") as failure:
        make_mesh(sensor, COARSE)
    assert "skin/surface/outer" in failure.value.remedy


@pytest.mark.parametrize(
    ("scale", "hint"), [(0.001, "scale: 1000"), (1000.0, "scale: 0.001"), (1 / 25.4, "scale: 25.4")]
)
def test_a_surface_in_another_unit_is_refused_with_the_scale(tmp_path, scale, hint):
    mesh = dome()
    mesh.apply_scale(scale)
    with pytest.raises(FormatError, match="spans x") as failure:
        read_sensor(written(tmp_path, document(surface={"file": "dome.stl"}), dome=mesh))
    assert hint in failure.value.remedy


def test_an_open_surface_is_refused_with_the_place(tmp_path):
    mesh = dome()
    mesh.update_faces(np.arange(len(mesh.faces)) != int(mesh.triangles_center[:, 0].argmax()))
    with pytest.raises(FormatError, match=r"not watertight: 3 open edges, the first near \(2.5"):
        read_sensor(written(tmp_path, document(surface={"file": "dome.stl"}), dome=mesh))


def test_files_of_cad_programs_are_answered_with_how_to_convert_them(tmp_path):
    (tmp_path / "skin.iges").write_text("")
    with pytest.raises(UsageError, match="IGES files are not read") as failure:
        read_sensor(written(tmp_path, document(surface={"file": "skin.iges"})))
    assert "STL" in failure.value.remedy


@pytest.mark.parametrize(
    ("skin", "contact", "words"),
    [
        ({"protrusion_height": 0.5}, {}, "protrusion_radius 0 mm"),
        ({"curvature_radius_x": 2.0}, {}, "curvature_radius_x 2 mm"),
        ({"curvature_radius_x": 3.2, "curvature_radius_y": 2.7, "underside": "flat"}, {}, "corners"),
        ({"curvature_radius_y": 2.7, "underside": "flat", "thickness": 1.0}, {}, "falls to z"),
        ({"protrusion_radius": 0.4, "curvature_radius_x": 20.0}, {"bonded": ["sides"], "board": True}, "flat board"),
        ({"protrusion_radius": 0.4}, {"bonded": ["bottom"], "board": True}, "not both"),
        ({}, {"bonded": ["rim"], "rim_width": 2.5}, "covers the whole underside"),
        ({"surface": {"file": "x.stl"}}, {}, "no file"),
    ],
)
def test_contradictions_are_refused_in_words(skin, contact, words):
    values = document(**skin)
    values["contact"] = {"friction": 0.2, "bonded": ["bottom"], **contact}
    with pytest.raises((FormatError, UsageError), match=words):
        Sensor.from_document(values, "file")


def test_the_sizes_of_a_curved_pad_survive_its_file(tmp_path):
    skin = Skin(5.0, 5.0, 2.0, 0.0, None, 9.0, 11.0, "flat")
    sensor = replace(slab_sensor(size=5.0), skin=skin)
    values = sensor.document
    assert values["skin"]["curvature_radius_y"] == 11.0
    assert read_sensor(written(tmp_path, values)).skin == skin


def test_a_mesh_that_does_not_take_the_true_faces_is_made_again(monkeypatch):
    """fTetWild's next one may; a skin that never does is refused with the reason."""
    sensor, calls = slab_sensor(), []

    def quadratic(sensor, vertices, tets):
        calls.append(len(calls))
        if len(calls) < wanted:
            raise SolveError("element 7 is flat", "positive volumes", "refine")
        return box_mesh(sensor, 2, 2, 2)

    monkeypatch.setattr(make, "quadratic", quadratic)
    monkeypatch.setattr(make, "tetrahedralize", lambda *_: (None, None))
    wanted = 3
    assert len(make_mesh(sensor, COARSE).tets) == 48 and len(calls) == 3
    wanted = 99
    with pytest.raises(SolveError, match="element 7 is flat"):
        make_mesh(sensor, COARSE)
    assert len(calls) == 6
