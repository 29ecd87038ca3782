"""A solid from a file as an indenter, against the closed forms of what was tessellated."""

import dataclasses

import numpy as np
import pytest
import trimesh
import yaml
from test_indenters_conform import Parameters, compiled, distance, gradient

from tacdata.cases.case import read_case
from tacdata.errors import FormatError, UsageError
from tacdata.indenters import from_document
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.mesh import Mesh
from tacdata.indenters.sphere import Sphere
from tacdata.plans import Plan, read_plan
from tacdata.plans.beside_skin import tip_aside
from tacdata.sensor import default_sensor
from tacdata.surfaces import distance_grid
from tacdata.warp_runtime import wp


def tessellated_punch(steps, sections):
    angle = np.linspace(0, np.pi / 2, steps + 1)
    line = np.stack([1.7 + 0.3 * np.sin(angle), 0.3 * (1 - np.cos(angle))], axis=-1)
    return trimesh.creation.revolve(np.array([[0, 0], *line, [2.0, 8.0], [0, 8.0]]), sections=sections)


def tessellated_ball(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=2.0)
    mesh.apply_translation([0, 0, 7.5])
    return mesh


def indenter_of(mesh, folder, **more):
    mesh.export(folder / "shape.stl")
    return from_document({"shape": "mesh", "file": "shape.stl", **more}, "plan", folder)


def plan_of(indenter):
    motion = {"clearance": 2, "travel_speed": 10, "approach_speed": 5, "press_speed": 1, "hold": 1, "rest": 1}
    return {
        "version": "1.0",
        "name": "own",
        "indenters": {"thumb": indenter},
        "motion": motion,
        "presses": [{"indenter": "thumb", "x": 0, "y": 0, "depth": 0.5}],
    }


CASES = {
    "fine ball": (lambda: tessellated_ball(5), Sphere(2.0), 0.5e-3, 0.004),
    "coarse ball": (lambda: tessellated_ball(3), Sphere(2.0), 1e-3, 0.012),
    "fine punch": (lambda: tessellated_punch(16, 128), FlatPunch(2.0, 0.3), 0.6e-3, 0.02),
    "coarse punch": (lambda: tessellated_punch(8, 64), FlatPunch(2.0, 0.3), 1.2e-3, 0.04),
}
"""Solid, closed form, largest error of distance [mm] and of normals [rad] near the surface."""


@pytest.fixture(params=CASES, scope="module")
def pair(request, tmp_path_factory):
    make, exact, far, turned = CASES[request.param]
    return indenter_of(make(), tmp_path_factory.mktemp("shapes")), exact, far, turned


def near_surface(exact):
    rng = np.random.default_rng(4)
    samples = np.linspace(-0.99, 0.99, 61) * exact.extent
    x, y = np.meshgrid(samples, samples, indexing="ij")
    points = np.stack([x, y, exact.profile(x, y)], axis=-1).reshape(-1, 3)
    points = points[points[:, 2] < 1.2]
    return points + rng.normal(0, 0.02, points.shape)


def test_distance_and_normals_are_those_of_the_solid_behind_the_facets(pair):
    indenter, exact, far, turned = pair
    points = near_surface(exact)
    assert np.abs(distance(indenter, points) - distance(exact, points)).max() < far
    difference = np.linalg.norm(gradient(indenter, points) - gradient(exact, points), axis=1)
    assert difference.max() < turned
    assert np.sqrt((difference**2).mean()) < 0.2 * turned + 1e-3


def test_profile_footprint_and_extent_are_those_of_the_solid(pair):
    indenter, exact, far, _ = pair
    x = np.linspace(-1.8, 1.8, 25)
    assert indenter.profile(x, 0 * x) == pytest.approx(exact.profile(x, 0 * x), abs=5 * far)
    assert indenter.extent == pytest.approx(exact.extent, rel=0.01)
    assert indenter.footprint(0.5, 20.0) == pytest.approx(exact.footprint(0.5, 20.0), abs=0.08)


def test_normals_carry_no_noise_of_facets(tmp_path):
    """Along a meridian of a ball of 0.3 mm facets (turns of 8 deg) the normal turns evenly."""
    indenter = indenter_of(tessellated_ball(3), tmp_path)
    angle = np.linspace(0, 0.8, 400)
    points = 2.0 * np.stack([np.sin(angle), 0 * angle, 1 - np.cos(angle)], axis=-1)
    normal = gradient(indenter, points)
    turned = np.arctan2(normal[:, 0], -normal[:, 2])
    assert np.abs(turned - angle).max() < np.radians(0.6)
    assert np.abs(np.diff(turned) - np.diff(angle)).max() < np.radians(0.1), "no jump between samples 0.1 deg apart"


def test_the_name_of_the_file_and_its_folder_do_not_count(tmp_path):
    first = indenter_of(tessellated_ball(2), tmp_path)
    (tmp_path / "elsewhere").mkdir()
    second = indenter_of(tessellated_ball(2), tmp_path / "elsewhere")
    assert first == second
    assert str(tmp_path) not in str(first.document)
    assert first == dataclasses.replace(second, file="renamed.stl")
    assert first != dataclasses.replace(first, scale=2.0)


def test_a_document_is_enough_where_the_file_was_read_before(tmp_path):
    document = indenter_of(tessellated_ball(2), tmp_path).document
    (tmp_path / "shape.stl").unlink()
    again = from_document(document, "recording")
    assert again.profile(np.zeros(1), np.zeros(1)) == pytest.approx([0.0], abs=2e-3)


def test_without_the_file_it_can_be_named_but_not_used():
    indenter = from_document({"shape": "mesh", "file": "lost.stl", "sha256": "a" * 64}, "recording")
    assert indenter.document["file"] == "lost.stl"
    with pytest.raises(UsageError, match="not on this machine"):
        _ = indenter.extent


def test_a_plan_names_its_shapes_by_content(tmp_path):
    tessellated_ball(2).export(tmp_path / "thumb.stl")
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan_of({"shape": "mesh", "file": "thumb.stl"})))
    read = read_plan(tmp_path / "plan.yaml")
    assert len(read.document["indenters"]["thumb"]["sha256"]) == 64
    (tmp_path / "thumb.stl").unlink()
    assert Plan.from_document(read.document, "session").presses[0].indenter == read.presses[0].indenter


@pytest.mark.parametrize(("factor", "hint"), [(0.001, "scale: 1000"), (1000.0, "scale: 0.001")])
def test_a_file_in_another_unit_is_refused_with_the_scale(tmp_path, factor, hint):
    mesh = tessellated_ball(2)
    mesh.apply_scale(factor)
    with pytest.raises(FormatError, match="with scale 1") as failure:
        indenter_of(mesh, tmp_path)
    assert hint in failure.value.remedy
    scale = float(hint.split(": ")[1])
    assert indenter_of(mesh, tmp_path, scale=scale).extent == pytest.approx(2.0, rel=0.01)


def test_an_open_solid_is_refused(tmp_path):
    mesh = tessellated_ball(2)
    mesh.update_faces(np.arange(len(mesh.faces)) > 3)
    with pytest.raises(FormatError, match="not watertight"):
        indenter_of(mesh, tmp_path)


def test_a_changed_file_is_refused(tmp_path):
    document = indenter_of(tessellated_ball(2), tmp_path).document
    tessellated_ball(1).export(tmp_path / "shape.stl")
    with pytest.raises(FormatError, match="has changed"):
        from_document(document, "plan", tmp_path)


@pytest.mark.parametrize(
    ("change", "word"), [({"file": 3}, "file"), ({"sha256": "abc"}, "sha256"), ({"scale": "1"}, "scale")]
)
def test_parameters_of_the_wrong_kind_are_refused(change, word):
    with pytest.raises(FormatError, match=word):
        dataclasses.replace(Mesh.example(), **change)


def test_a_missing_file_name_is_asked_for():
    with pytest.raises(FormatError, match="exactly file, sha256"):
        from_document({"shape": "mesh"}, "plan")


def test_the_address_survives_single_precision():
    handle = Mesh.example().device_parameters("cpu")
    assert tuple(float(np.float32(value)) for value in handle) == handle


@pytest.mark.gpu
@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device")
def test_the_distance_is_the_same_on_cuda():
    indenter = Mesh.example()
    points = np.random.default_rng(6).uniform(-4, 5, (3000, 3))
    q = Parameters(*indenter.device_parameters("cuda:0"), *[0.0] * 6)
    found = wp.zeros(len(points), dtype=wp.float64, device="cuda:0")
    places = wp.array(points, dtype=wp.vec3d, device="cuda:0")
    wp.launch(compiled("mesh"), len(points), inputs=[places, q, found], device="cuda:0")
    assert found.numpy() == pytest.approx(distance(indenter, points), abs=1e-12)


@pytest.mark.parametrize("place", [(105.0, 62.5), (2.0, 2.0), (0.0, -2.0)])
def test_a_solid_beside_its_axis_is_refused_with_the_move_that_mends_it(place, tmp_path):
    """A build plate's corner is no press axis: such a solid would press beside the skin."""
    mesh = tessellated_ball(3)
    mesh.apply_translation([*place, 0.0])
    with pytest.raises(FormatError, match="passes beside it") as caught:
        indenter_of(mesh, tmp_path)
    assert f"move it by ({0 - place[0]:.4g}, {0 - place[1]:.4g}) mm" in str(caught.value)


def test_a_small_file_may_be_in_inches(tmp_path):
    with pytest.raises(FormatError, match="with scale 1") as caught:
        indenter_of(tessellated_ball(3).apply_scale(1 / 25.4), tmp_path)
    assert "25.4 (inches)" in caught.value.remedy


def tipped_aside(place):
    """A holder around the axis whose tip stands aside."""
    holder = trimesh.creation.box(bounds=[[-10.0, -10.0, 6.0], [45.0, 10.0, 12.0]])
    tip = trimesh.creation.cylinder(radius=2.0, segment=[[place, 0, 0], [place, 0, 8.0]])
    return trimesh.boolean.union([holder, tip], engine="manifold")


@pytest.mark.parametrize(
    ("solid", "aside"),
    [(lambda: tipped_aside(35.0), 33.0), (lambda: trimesh.creation.annulus(r_min=55.0, r_max=60.0, height=4.0), 55.0)],
    ids=["tip aside", "wide ring"],
)
def test_a_solid_that_would_never_touch_the_skin_is_refused_by_plans_and_cases(solid, aside, tmp_path, monkeypatch):
    """Its axis may pass through the solid's box, and its lowest part still lie beside the skin."""
    # A coarse grid of distances; no other test asks these solids, so that none finds it in the cache.
    monkeypatch.setattr(distance_grid, "NODES", 300_000)
    part = indenter_of(solid(), tmp_path)
    with pytest.raises(FormatError, match="does not touch the skin") as caught:
        Plan.from_document(plan_of(part.document), "plan").check_against(default_sensor())
    said = float(str(caught.value).split("part lies ")[1].split(" mm beside the press axis")[0])
    assert said == pytest.approx(aside, abs=1.5)
    case = {"version": "1.0", "name": "own", "indenter": part.document, "depths": [0.25, 0.5]}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case))
    with pytest.raises(FormatError, match="does not touch the skin"):
        read_case(tmp_path / "case.yaml")


def test_a_tip_beside_its_axis_is_said_with_its_place(tmp_path):
    ball = tessellated_ball(3).apply_translation([1.5, 0.0, 0.0])
    assert "1.5 mm beside the press axis" in tip_aside(indenter_of(ball, tmp_path))
    assert tip_aside(Mesh.example()) == "" and tip_aside(Sphere(2.0)) == ""


def test_two_tips_on_one_holder_may_leave_the_axis_free(tmp_path):
    tips = [tessellated_ball(3).apply_translation([side * 4.0, 0.0, 0.0]) for side in (-1, 1)]
    holder = trimesh.creation.box(extents=[14.0, 4.0, 4.0]).apply_translation([0.0, 0.0, 10.0])
    solid = trimesh.boolean.union([*tips, holder], engine="manifold")
    assert indenter_of(solid, tmp_path).extent > 5.0
