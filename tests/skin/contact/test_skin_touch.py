"""Turned indenters and curved faces: where a press starts, how far it reaches, and what a tilted punch leaves."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, slab_sensor

from tacdata import documents
from tacdata.cases.case import read_case
from tacdata.errors import SolveError
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.ring import Ring
from tacdata.indenters.sphere import Sphere
from tacdata.sensor.sensor import ContactProperties, Skin
from tacdata.skin.contact import first_touch as touching
from tacdata.skin.contact.contact_surface import SUBDIVISIONS, face_quadrature
from tacdata.skin.contact.first_touch import reach, rise, rotation, thickness_at, touch
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.mesh.elements import triangle_hats, triangle_quadrature
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.surface.outer_face import OuterFace

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "benchmarks"))

from solvers.getfem import with_nodal_contact

PUNCH = FlatPunch(1.2, 0.5)
PEER = with_nodal_contact(residual=1e-8)
CURVED = replace(slab_sensor(size=8.0), skin=Skin(8.0, 8.0, 2.0, 0.0, curvature_radius_x=10.0, underside="flat"))


def press(indenter, depth, tilt_x=0.0, tilt_y=0.0, x=0.0, y=0.0, yaw=0.0):
    return PressRequest(indenter, x, y, yaw, (depth,), tilt_x, tilt_y)


@pytest.fixture(scope="module")
def model():
    sensor = slab_sensor()
    return SkinModel(sensor, ModelSettings(error_estimate=False), mesh=box_mesh(sensor, 8, 8, 2))


def punch_distance(points):
    """Signed distance of the punch [mm], written anew: a disc at height e, of radius r - e, thickened by e."""
    out = np.maximum(np.hypot(points[:, 0], points[:, 1]) - 0.7, 0.0)
    return np.where(points[:, 2] < 0.5, np.hypot(out, points[:, 2] - 0.5), out) - 0.5


def test_a_rotation_is_made_once_and_is_each_callers_own(monkeypatch):
    made, turned = [], touching.turned
    monkeypatch.setattr(touching, "turned", lambda *angles: made.append(angles) or turned(*angles))
    first = rotation(press(Sphere(1.0), 0.3, tilt_x=7.25, yaw=11.5))
    first[0, 0] = 9.0
    second = rotation(press(Sphere(2.0), 0.5, tilt_x=7.25, yaw=11.5))
    assert len(made) == 1
    assert np.allclose(second @ second.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 3.0, 12.0, 30.0])
def test_the_lowest_point_of_turned_shapes_by_closed_forms(tilt):
    t = np.radians(tilt)
    about_y = rotation(press(Sphere(2.0), 0.1, tilt_y=tilt))
    assert rise(Sphere(2.0), about_y) == pytest.approx(2.0 * (1 - np.cos(t)), abs=1e-6)
    for turn in (about_y, rotation(press(PUNCH, 0.1, tilt_x=tilt, yaw=40.0))):
        assert rise(PUNCH, turn) == pytest.approx(0.7 * np.sin(t) + 0.5 * (1 - np.cos(t)), abs=1e-6)
    ring = Ring(1.5, 0.3)
    assert rise(ring, about_y) == pytest.approx(1.5 * np.sin(t) + 0.3 * (1 - np.cos(t)), abs=1e-6)


def test_a_tilted_punch_is_where_its_rotated_distance_says(model):
    """No mean gap under a hat is negative, those under the punch are zero, and the deepest node is as deep as asked."""
    request = press(PUNCH, 0.3, tilt_x=3.0, tilt_y=6.0)
    [(_, state)] = model.states(request)
    nodes, faces = model.mesh.nodes, model.mesh.outer
    weights, shapes = (v.numpy() for v in face_quadrature(torch.as_tensor(nodes), torch.as_tensor(faces), SUBDIVISIONS))
    origin = touch(model.sensor, model.skin.face, request) - [0, 0, 0.3]
    points = np.einsum("ka,fai->fki", shapes, (nodes + state.displacement)[faces])
    gap = punch_distance(((points - origin) @ rotation(request)).reshape(-1, 3)).reshape(weights.shape)
    share = triangle_hats(triangle_quadrature(SUBDIVISIONS)[0])
    total, area = np.zeros(len(nodes)), np.zeros(len(nodes))
    np.add.at(total, faces, np.einsum("fk,ka->fa", weights * gap, share))
    np.add.at(area, faces, np.einsum("fk,ka->fa", weights, share))
    under = np.unique(faces)
    mean = total[under] / area[under]
    allowed = model.settings.solver.penetration * 0.3
    assert mean.min() > -allowed
    assert (np.abs(mean) <= allowed).sum() >= 6
    assert -state.displacement[under, 2].min() == pytest.approx(0.3, abs=0.03)


def test_a_tilt_leans_the_map_and_not_the_force(model):
    one, other = (model.solve(press(PUNCH, 0.3, tilt_y=tilt)) for tilt in (6.0, -6.0))
    upright = model.solve(press(PUNCH, 0.3))
    lean = one.surface[0].sum(axis=1) @ model.sensor.map.x / one.surface[0].sum()
    # A positive turn about y lifts the side of negative x, so that the punch digs in at positive x.
    assert lean > 0.05
    # Mirrored up to the mesh, whose cells all are cut along one diagonal.
    assert np.sqrt(((other.surface[0][::-1] - one.surface[0]) ** 2).mean()) < 0.03 * 0.3
    # Nothing tells one place of a wide slab from another, so that its energy, and without friction the force, has no
    # component along it: what the leaning flat pushes to one side, the edge that digs in pushes to the other.
    assert abs(one.force[0, 0]) < 0.03 * one.force[0, 2]
    assert one.force[0, 2] < upright.force[0, 2]


def test_a_press_on_a_curved_pad_starts_at_its_local_height():
    request = press(Sphere(2.0), 0.3, x=2.0)
    height = 2.0 - 10.0 + np.sqrt(10.0**2 - 2.0**2)
    found = touch(CURVED, OuterFace(box_mesh(slab_sensor(size=8.0), 4, 4, 1)), request)
    assert found == pytest.approx([2.0, 0.0, height], abs=1e-12)
    assert thickness_at(CURVED, request) == pytest.approx(height)
    # The face falls away towards the rim and rises towards the middle.
    flat = replace(CURVED, skin=Skin(8.0, 8.0, 2.0, 0.0))
    assert reach(flat, request) == pytest.approx(Sphere(2.0).footprint(0.3, 0.0))
    assert reach(CURVED, request)[0] > reach(flat, request)[0]


def test_a_press_through_the_thin_border_of_a_curved_pad_is_refused():
    request = press(Sphere(1.0), 1.3, x=3.9)
    with pytest.raises(SolveError, match=r"skin 1\.21 mm thick at \(3\.9, 0\) mm"):
        check_press(request, CURVED)
    check_press(press(Sphere(1.0), 1.3), CURVED)


@pytest.mark.parametrize("shape", [Sphere(0.4), Ring(1.2, 0.4)])
def test_a_press_that_hides_the_whole_shape_in_the_skin_is_refused(shape):
    """What holds it would press as well, and its file does not say what that is."""
    check_press(press(shape, 0.8), slab_sensor())
    with pytest.raises(SolveError, match=r"0\.8 mm high.*says what holds it"):
        check_press(press(shape, 0.81), slab_sensor())


def test_a_tilt_may_bring_a_shape_over_the_rim():
    sensor = replace(slab_sensor(), contact=ContactProperties(0.0, ("sides",), False))
    long = FlatPunch(1.5, 0.2)
    check_press(press(long, 0.3, x=1.45), sensor)
    with pytest.raises(SolveError, match="over the rim"):
        check_press(press(FlatPunch(1.5, 0.2), 0.3, tilt_y=4.0, x=1.7), sensor)


@pytest.mark.parametrize("wrong", [{"tilt_x": 31.0}, {"tilt_y": -40.0}, {"tilt_x": float("nan")}])
def test_impossible_tilts_are_refused(wrong):
    with pytest.raises(SolveError, match="tilts"):
        check_press(press(PUNCH, 0.1, **wrong), slab_sensor())


def test_case_files_tilt(tmp_path):
    document = {
        "version": "1.2",
        "name": "tilted",
        "sensor": slab_sensor().document,
        "indenter": PUNCH.document,
        "depths": [0.2],
        "tilt_x": 2.0,
        "tilt_y": -3.0,
    }
    documents.write(tmp_path / "case.json", document, "case")
    request = read_case(tmp_path / "case.json").request
    assert (request.tilt_x, request.tilt_y) == (2.0, -3.0)


def test_off_the_middle_a_curved_pad_answers_as_in_the_middle():
    """A pad bent with its underside: off the middle the same depth takes the same force, up to the slope."""
    sensor = replace(CURVED, skin=Skin(8.0, 8.0, 2.0, 0.0, curvature_radius_x=20.0))
    # Two cells off the middle of a regular mesh the elements under the press are the same ones.
    x = 2 * 8.0 / 12
    model = SkinModel(sensor, ModelSettings(error_estimate=False), mesh=box_mesh(sensor, 12, 12, 3))
    middle, beside = (model.solve(press(Sphere(2.0), 0.3, x=x)).force[0] for x in (0.0, x))
    assert beside[2] == pytest.approx(middle[2], rel=0.02)
    # The face slopes by x / 20 there: the force leans with it.
    assert beside[0] / beside[2] == pytest.approx(x / 20, rel=0.2)


@pytest.mark.long("tacdata/skin", "benchmarks/solvers", reason="another code solves it too")
@pytest.mark.skipif(PEER.missing() is not None, reason=str(PEER.missing()))
def test_another_code_presses_a_tilted_punch_alike(model, tmp_path):
    """GetFEM on the same mesh, contact at the same points: force within 0.5 %, the face within 1 % of the depth rms."""
    # GetFEM's displacements alone: volumes at the points.
    model = SkinModel(model.sensor, replace(model.settings, averaged_from=0.5), mesh=model.mesh)
    request = press(PUNCH, 0.2, tilt_x=2.0, tilt_y=5.0, yaw=20.0)
    [(_, ours)] = model.states(request)
    theirs = PEER.solve(SimpleNamespace(sensor=model.sensor, request=request), model.mesh, tmp_path)
    top = np.unique(model.mesh.outer)
    off = theirs.displacement[0][:, 2] - ours.displacement[top, 2]
    print(ours.force, theirs.force, np.sqrt((off**2).mean()))
    assert theirs.force[0] == pytest.approx(ours.force[2], rel=0.005)
    assert np.sqrt((off**2).mean()) < 0.01 * 0.2
