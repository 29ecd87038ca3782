"""Held faces that give way a little: against a layer in closed form, whole states with moved faces, and energy."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skin_examples import box_mesh, bumps_sensor, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.skin.derivatives.bonding import Bonding, held_faces
from tacdata.skin.derivatives.parameter_names import known
from tacdata.skin.derivatives.path_uncertainty import with_uncertainty
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.derivatives.uncertainty import sampled_spread, uncertainties
from tacdata.skin.member.pose import Pose
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.configuration import Configuration, Unknowns
from tacdata.skin.solve.settings import SolverSettings

PRESS = PressRequest(Sphere(1.5), 0.13, -0.21, 0.0, (0.1, 0.2, 0.3))


def slab(residual=1e-9, **contact):
    sensor = slab_sensor(size=4.0, pixels=9)
    sensor = replace(sensor, contact=replace(sensor.contact, **contact))
    solver = SolverSettings(residual=residual, penetration=1e-7, mean_penetration=1e-7)
    return SkinModel(sensor, ModelSettings(solver=solver, error_estimate=False), mesh=box_mesh(sensor, 4, 4, 2))


def test_held_faces_are_those_of_the_bonded_parts():
    skin = slab()
    area = 4.0 * 4.0
    bonding = Bonding(skin.mesh, skin.skin.fixed)
    faces = held_faces(skin.mesh, skin.skin.fixed)
    assert len(faces) == 2 * 16 and (skin.mesh.nodes[faces][..., 2] == 0).all()
    # A uniform traction t [MPa] gives nodal forces whose sum is t times the area, and moves all nodes by -t.
    normals = np.zeros((len(skin.mesh.nodes), 3, 1))
    for nodes in faces:  # a straight quadratic triangle loads its mid-sides by a third each
        normals[nodes[3:], 2, 0] += 0.5 / 3
    assert normals.sum() == pytest.approx(area)
    moved = bonding.slack(torch.as_tensor(0.02 * normals)).numpy()
    np.testing.assert_allclose(moved[skin.skin.fixed, 2, 0], -0.02, atol=1e-12)
    assert not moved[~skin.skin.fixed].any() and not moved[:, :2].any()


def test_a_state_with_moved_faces_is_what_the_derivative_says():
    skin, request = slab(residual=1e-10), replace(PRESS, depths=(0.2,))
    [(_, state, sensitivity)] = sensitivities(skin, request, ["bonding", "x"])
    slack = Bonding(skin.mesh, skin.skin.fixed).slack(_reaction(skin, state))
    step = 1e-4  # mm/MPa
    ends = [_solved(skin, request, state, sign * step * slack) for sign in (1.0, -1.0)]
    force, surface = ((a - b) / (2 * step) for a, b in zip(*ends, strict=True))
    np.testing.assert_allclose(sensitivity.force[0], force, atol=1e-4 * np.abs(force).max())
    np.testing.assert_allclose(sensitivity.surface[0], surface, atol=2e-3 * np.abs(surface).max())
    assert sensitivity.force[0, 2] < 0, "a skin that gives way pushes back less"


def _solved(skin, request, state, moved):
    """Force and map of the same press with its held faces moved beforehand; no derivative is used."""
    press, newton = skin.skin.placed(0, request), skin.skin.newton([request])
    place = torch.as_tensor(press.touch - [0, 0, request.depths[0]])[:, None]
    pose, everyone = Pose(place, torch.eye(3, dtype=torch.float64)[..., None]), torch.ones(1, dtype=torch.bool)
    u, histories = torch.as_tensor(state.displacement)[..., None] + moved, (newton.surfaces[0].start(pose),)
    none = torch.zeros(1, dtype=torch.float64)
    pressure = torch.zeros(newton.surfaces[0].count, 1, dtype=torch.float64)
    at = Configuration(u, (pressure,), press.conditions, (pose,), histories, none, none)
    now = newton.residual(at)
    while float(now.relative) > 1e-9 or float(now.penetration) > 1e-9:
        at.unknowns = at.unknowns.plus(Unknowns(*newton.step(at, now, everyone)[:2]))
        now = newton.residual(at)
    u = at.u
    held = skin.skin.fixed
    np.testing.assert_allclose((u[..., 0] - torch.as_tensor(state.displacement))[held], moved[held, :, 0])
    grid = skin.sensor.map
    surface = skin.skin.face.depth_map(grid.x, grid.y, u[..., 0].numpy(), grid.sampling)
    return -now.contacts[0].force[:, 0].numpy(), surface


def _reaction(skin, state):
    """Force of the bond on every held node [N]: what holds it against the body; no contact lies there."""
    own = skin.skin.placed(0, PRESS).conditions
    internal = skin.skin.body.internal_force(torch.as_tensor(state.displacement)[..., None], own)[0]
    internal[torch.as_tensor(~skin.skin.fixed)] = 0.0
    return internal


def test_the_work_saved_is_half_of_what_the_bond_takes_up():
    """Without friction: d/dc of the indenter's work is -1/2 of the integral of t^2 over the held faces."""
    skin, depths = slab(), tuple(np.linspace(0.0, 0.3, 7))
    found = [(s, d) for _, s, d in sensitivities(skin, replace(PRESS, depths=depths), ["bonding"])]
    slope = np.array([d.force[0, 2] for _, d in found])
    saved = np.trapezoid(slope, depths)
    reaction = _reaction(skin, found[-1][0])
    taken = 0.5 * float((reaction * Bonding(skin.mesh, skin.skin.fixed).slack(reaction)).sum())
    assert saved == pytest.approx(taken, rel=0.05)


@pytest.mark.long("tacdata/skin", reason="a press and its derivatives, five times over")
def test_its_spread_is_in_a_labels_uncertainty_by_derivatives_and_beside_samples():
    skin = slab(residual=5e-4)
    assert known(skin.sensor, PRESS.indenter)["bonding"] == "mm/MPa"
    [*_, (_, _, alone)] = uncertainties(skin, PRESS, {"bonding": 0.1})
    [*_, (_, _, less)] = uncertainties(skin, PRESS, {"bonding": 0.1, "youngs_modulus": 0.01})
    [*_, (_, sampled)] = sampled_spread(skin, PRESS, {"bonding": 0.1, "youngs_modulus": 0.01}, 3)
    [*_, (_, apart)] = sampled_spread(skin, PRESS, {"youngs_modulus": 0.01}, 3)
    assert alone.force[2] > 0 and less.force[2] > alone.force[2]
    np.testing.assert_allclose(sampled.force, np.hypot(apart.force, alone.force))
    stated = replace(skin.sensor, uncertainty={"bonding": 0.1})
    told = SkinModel(stated, skin.settings, mesh=skin.mesh, companion=skin.mesh)
    solution = with_uncertainty(told, PRESS, told.solve(PRESS))
    assert solution.force_uncertainty is not None
    # Those of a label stop at an error of 1e-2, those that they are held against at 1e-5.
    np.testing.assert_allclose(solution.force_uncertainty[-1], alone.force, atol=1e-2 * np.linalg.norm(alone.force))
    assert solution.provenance["uncertainty"]["units"] == {"bonding": "mm/MPa"}


def test_sides_that_give_way_unload_no_protrusion_by_themselves():
    """Softer sides carry less of a press, so that the board under the protrusions carries more of the same depth."""
    sensor = bumps_sensor()
    skin = SkinModel(sensor, ModelSettings(mesh=MeshSettings(outer=0.8, interior=1.5), error_estimate=False))
    request = PressRequest(Sphere(3.0), 0.0, 0.0, 0.0, (0.0, 0.3))
    [*_, (_, state, sensitivity)] = sensitivities(skin, request, ["bonding"])
    carried = state.taxel_force.sum() / state.force[2]
    more = (sensitivity.taxel_force[0].sum() * state.force[2] - state.taxel_force.sum() * sensitivity.force[0, 2]) / (
        state.force[2] ** 2
    )
    assert 0 < carried < 1 and more > 0
