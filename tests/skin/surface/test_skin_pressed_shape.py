"""Depth maps where the skin touches: they are the shape's own surface, and no point of the skin lies in a shape."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from skin_examples import DEVICES, PLAIN, box_mesh, slab_sensor

from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.mesh import Mesh
from tacdata.indenters.ring import Ring
from tacdata.indenters.sphere import Sphere
from tacdata.sensor.sensor import ContactProperties
from tacdata.skin.contact.first_touch import rotation
from tacdata.skin.mesh import elements
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.surface.depth_map import DepthRaster
from tacdata.skin.surface.outer_face import OuterFace
from tacdata.skin.surface.pressed_shape import PressedShape, around, touching_share

SENSOR = slab_sensor(size=6.0, thickness=2.0, pixels=27)
X, Y = np.linspace(-2.6, 2.6, 27), np.linspace(-2.6, 2.6, 27)
GRID = np.meshgrid(X, Y, indexing="ij")
EVEN = np.eye(3)


@pytest.fixture(scope="module")
def mesh():
    return box_mesh(SENSOR, 6, 6, 2)


def level(mesh, depth):
    """The face as a whole moved down [mm]."""
    return np.array([0.0, 0.0, -depth]) * np.ones((len(mesh.nodes), 1))


def pressed(mesh, shape, lowest, touching=None, turn=EVEN, down=0.0):
    """Depth map [mm] of a level face under a shape whose lowest point is at depth ``lowest`` [mm]."""
    count = len(np.unique(mesh.outer))
    marks = np.zeros(count, bool) if touching is None else touching
    at = PressedShape(shape, np.array([0.0, 0.0, 2.0 - lowest]), turn, 2.0 - lowest, marks, marks)
    return OuterFace(mesh).pressed_maps(X, Y, [level(mesh, down)], "point", [at])[0]


def contact_places(mesh):
    return mesh.nodes[np.unique(mesh.outer)][:, :2]


def test_a_face_inside_a_shape_comes_down_to_its_surface_whatever_nodes_say(mesh):
    found = pressed(mesh, Sphere(2.0), 0.01)
    assert found == pytest.approx(np.maximum(0.01 - Sphere(2.0).profile(*GRID), 0.0), abs=2e-6)
    assert found.max() == pytest.approx(0.01, abs=2e-6)


def test_under_a_tilted_shape_it_comes_down_along_the_vertical(mesh):
    request = PressRequest(FlatPunch(1.0, 0.2), 0.0, 0.0, 0.0, (0.1,), tilt_x=5.0)
    found = pressed(mesh, request.indenter, 0.0, turn=rotation(request))
    # The bottom is a plane through the origin, inclined by 5 degrees about x.
    inside = np.hypot(*GRID) < 0.7
    assert found[inside] == pytest.approx(np.maximum(-np.tan(np.radians(5.0)) * GRID[1][inside], 0.0), abs=2e-6)


def test_a_ring_has_an_underside_alone(mesh):
    """What the hole leaves free stays where it is."""
    ring = Ring(1.2, 0.5)
    found = pressed(mesh, ring, 0.01)
    assert found == pytest.approx(np.maximum(0.01 - ring.profile(*GRID), 0.0), abs=2e-6)
    assert found[13, 13] == 0.0


def test_a_face_off_the_shape_goes_up_to_it_between_nodes_that_carry_pressure(mesh):
    ball, places = Sphere(4.0), contact_places(mesh)
    touching = np.hypot(*places.T) < 0.3
    found = pressed(mesh, ball, 0.005, touching, down=0.01)
    moved = found - 0.01
    weight = hats(mesh, touching)
    assert weight.max() == pytest.approx(1.0)
    # No point stays below the shape's lowest, at 0.005 mm, where hats sum to a tenth.
    to_lowest = 0.005 * np.minimum(weight / 0.1, 1.0)
    # From there up by weight; less beyond a gap of 0.025 mm, and nothing from 0.05 mm on.
    gap = ball.profile(*GRID) + 0.01 - 0.005 - to_lowest
    fade = np.clip(2 * (1 - gap / 0.05), 0.0, 1.0)
    assert moved == pytest.approx(-(to_lowest + weight * gap * fade), abs=2e-6)
    assert ((0 < fade) & (fade < 1) & (weight > 0)).any()
    assert np.abs(moved[weight == 0]).max() < 1e-12


def slots_of(mesh):
    """Contact nodes of each face."""
    return np.unique(mesh.outer, return_inverse=True)[1].reshape(mesh.outer.shape)


def hats(mesh, touching):
    """Sum of the hats of touching nodes above the pixels, by the undeformed face."""
    triangle, local = OuterFace(mesh).locate(np.stack(GRID, axis=-1).reshape(-1, 2))
    return (elements.triangle_hats(local) * touching[slots_of(mesh)[triangle]]).sum(axis=1).reshape(GRID[0].shape)


def test_a_point_far_below_a_flank_comes_up_to_the_lowest_point_alone(mesh):
    """Beside an edge a node may carry pressure while the shape is far above a pixel."""
    everywhere = np.ones(len(contact_places(mesh)), bool)
    found = pressed(mesh, Sphere(1.0), 0.0, everywhere, down=0.01)
    far = Sphere(1.0).profile(*GRID) > 0.051
    assert far.sum() > 600
    assert found[far] == pytest.approx(np.zeros(far.sum()), abs=1e-12), "to the shape's lowest point and no farther"
    assert found[13, 13] == pytest.approx(0.0, abs=2e-6)


def test_beside_the_contact_no_point_stays_below_the_lowest(mesh):
    """A coarse mesh dips beside a punch's edge, in the faces that touch and in those beside them."""
    ball, touching = Sphere(1.0), (np.hypot(*contact_places(mesh).T) < 0.3).astype(float)
    wide = around(touching, slots_of(mesh))
    assert (wide[np.hypot(*contact_places(mesh).T) < 0.9] == 1.0).all() and wide.mean() < 0.25
    at = PressedShape(ball, np.array([0.0, 0.0, 1.995]), EVEN, 1.995, touching, wide)
    [found] = OuterFace(mesh).pressed_maps(X, Y, [level(mesh, 0.01)], "point", [at])
    near = np.hypot(*GRID) < 0.8
    assert found[near].max() < 0.005 + 1e-9
    assert found[np.hypot(*GRID) > 2.0] == pytest.approx(0.01), "where skin may sag it stays"


@pytest.mark.parametrize(("bonded", "wider"), [("bottom", True), ("sides", False)])
def test_skin_that_hangs_in_a_frame_may_sag_lower_than_the_shape(mesh, bonded, wider):
    sensor = replace(SENSOR, contact=ContactProperties(0.0, (bonded,), False))
    model, request = SkinModel(sensor, PLAIN, mesh=mesh), PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.1,))
    traction = np.zeros((len(contact_places(mesh)), 3))
    traction[np.hypot(*contact_places(mesh).T) < 0.6, 2] = 0.05
    [at] = model.pressed_shapes(request, [0.1], [SimpleNamespace(traction=traction)])
    assert (at.around.sum() > 2 * at.touching.sum()) == wider
    assert wider or np.array_equal(at.around, at.touching)


def test_a_node_that_barely_touches_hardly_moves_the_map(mesh):
    """Solutions that agree within the solver's tolerance may differ in which nodes touch."""
    traction, slots = np.zeros((len(contact_places(mesh)), 3)), slots_of(mesh)
    near = np.hypot(*contact_places(mesh).T) < 0.3
    traction[near, 2] = 0.05
    once = touching_share(traction, slots)
    traction[np.flatnonzero(~near)[0], 2] = 1e-4
    again = touching_share(traction, slots)
    assert once[near] == pytest.approx(1.0) and once.sum() == near.sum()
    assert 0 < again.sum() - once.sum() < 0.03
    assert not touching_share(np.zeros((3, 3)), slots).any()


def test_a_node_amid_others_that_touch_does_as_well(mesh):
    """Under a flat face of a coarse mesh which nodes carry nothing is chance; beside the contact nothing changes."""
    places, slots = contact_places(mesh), slots_of(mesh)
    near = np.hypot(*places.T) < 1.6
    middle = np.hypot(*places.T).argmin()
    whole, holed = (np.zeros((len(places), 3)) for _ in range(2))
    whole[near, 2] = holed[near, 2] = 0.05
    holed[middle] = 0.0
    assert touching_share(holed, slots) == pytest.approx(near.astype(float))
    # As far as its neighbours: they count the less the less they carry.
    holed[np.hypot(*places.T) < 0.6, 2] = 0.002
    holed[middle] = 0.0
    share = touching_share(holed, slots)
    assert 0.3 < share[middle] < 0.5
    assert touching_share(whole, slots)[~near].max() == 0.0


def test_a_mean_over_a_pixel_is_of_the_shape_as_well(mesh):
    none = np.zeros(len(contact_places(mesh)))
    at = PressedShape(Sphere(2.0), np.array([0.0, 0.0, 1.9]), EVEN, 1.9, none, none)
    [found] = DepthRaster(mesh, X, Y, "area").pressed(torch.zeros(len(mesh.nodes), 3, 1, dtype=torch.float64), [at])
    offsets = np.linspace(-0.09, 0.09, 10)
    mean = np.mean([Sphere(2.0).profile(GRID[0] + a, GRID[1] + b) for a in offsets for b in offsets], axis=0)
    assert found.numpy()[13, 13] == pytest.approx(0.1 - mean[13, 13], abs=1e-4)


@pytest.mark.parametrize("sampling", ["point", "area"])
@pytest.mark.parametrize("shape", [Sphere(2.0), Ring(1.2, 0.5), Mesh.example()])
@pytest.mark.parametrize("device", DEVICES)
def test_maps_are_the_same_on_every_device(mesh, device, shape, sampling):
    """In the shape and off it, between nodes that touch more or less; a mesh's distance lies on the device."""
    wave = 0.02 * np.sin(9 * mesh.nodes[:, 0]) * np.cos(7 * mesh.nodes[:, 1])
    u = torch.zeros(len(mesh.nodes), 3, 1, dtype=torch.float64)
    u[:, 2, 0] = torch.as_tensor(wave - 0.05)
    touching = np.clip(1.5 - np.hypot(*contact_places(mesh).T), 0.0, 1.0)
    at = PressedShape(shape, np.array([0.2, 0.1, 1.93]), EVEN, 1.93, touching, around(touching, slots_of(mesh)))
    found, expected = (
        DepthRaster(mesh, X, Y, sampling, each).pressed(u.to(each), [at])[0].cpu().numpy() for each in (device, "cpu")
    )
    assert found == pytest.approx(expected, abs=1e-9)
    bare = DepthRaster(mesh, X, Y, sampling).depth(u)[0].numpy()
    assert (found > bare + 1e-3).any() and (found < bare - 1e-3).any(), "moved both ways"


def test_maps_of_many_states_at_once_are_those_of_each_alone(slab):
    request = PressRequest(Sphere(2.0), 0.13, -0.07, 0.0, (0.2, 0.4))
    depths, states = zip(*slab.states(request), strict=True)
    together = slab.figures(request, depths, list(states)).surface
    alone = [slab.figures(request, [d], [s]).surface[0] for d, s in zip(depths, states, strict=True)]
    assert np.array_equal(together, alone) and together[1].max() > together[0].max()


@pytest.mark.parametrize("shape", [FlatPunch(1.2, 0.3), Sphere(3.0)])
def test_a_solved_label_is_the_shape_where_it_touches_and_nowhere_inside_it(slab, shape):
    request = PressRequest(shape, 0.13, -0.07, 0.0, (0.3,))
    [(depth, state)] = slab.states(request)
    [at], raw = slab.pressed_shapes(request, [depth], [state]), slab.skin.face.depth_map(X, Y, state.displacement)
    [found] = slab.skin.face.pressed_maps(X, Y, [state.displacement], "point", [at])
    under = depth - shape.profile(GRID[0] - 0.13, GRID[1] + 0.07)
    inner = np.hypot(GRID[0] - 0.13, GRID[1] + 0.07) < (0.8 if shape.shape == "flat_punch" else 0.5)
    off, bare = np.abs(found - under)[inner], np.abs(raw - under)[inner]
    # Under a punch some nodes of a coarse mesh carry no pressure, and which ones is chance.
    assert off.max() < 1e-5 and bare.max() > 5e-3
    assert (found >= under - 1e-5).all()
    assert found.max() < depth + 1e-6
