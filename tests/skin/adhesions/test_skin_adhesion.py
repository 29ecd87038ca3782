"""Adhesion: limits in closed form, energy, the jump off the skin, and what it is refused for."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import kuhn_mesh, slab_sensor

from tacdata import registry
from tacdata.errors import FormatError, SolveError, UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import Adhesion, Sensor
from tacdata.skin.adhesions import load_adhesion_law
from tacdata.skin.adhesions.adhesion_law import BASE, ROOM
from tacdata.skin.contact.adhesion import AdhesiveSurface
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.derivatives.press import sensitivities
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.settings import SolverSettings
from tacdata.skin.validity import fineness
from tacdata.warp_runtime import wp

LAWS = registry.names(ROOM, BASE)


def sticky(adhesion, size=6.0, thickness=3.0, friction=0.0, modulus=0.30) -> Sensor:
    slab = slab_sensor(size=size, thickness=thickness, friction=friction)
    material = replace(slab.material, youngs_modulus=modulus)
    return replace(slab, contact=replace(slab.contact, adhesion=adhesion), material=material)


def model(sensor, cells=8, layers=3, finer=1.7, residual=5e-4):
    """A slab whose cells grow from the middle outward and downward."""
    half, thick = sensor.skin.size_x / 2, sensor.skin.thickness
    line = np.linspace(-1, 1, cells + 1)
    x = half * np.sign(line) * np.abs(line) ** finer
    z = thick * (1 - np.linspace(1, 0, layers + 1) ** 1.5)
    settings = ModelSettings(error_estimate=False, solver=SolverSettings(residual=residual))
    return SkinModel(sensor, settings, mesh=kuhn_mesh(sensor, [x, x, z]))


def forces(skin, radius, depths):
    request = PressRequest(Sphere(radius), 0.0, 0.0, 0.0, tuple(depths))
    return np.array([state.force[2] for _, state in skin.states(request)])


@pytest.mark.parametrize("name", LAWS)
def test_a_law_parts_at_the_work_stated_and_its_parts_belong_together(name):
    shape, slope, rest = load_adhesion_law(name).functions()

    @wp.kernel(module="unique")
    def values(s: wp.array(dtype=wp.float64), out: wp.array2d(dtype=wp.float64)):
        i = wp.tid()
        out[i, 0] = shape(s[i])
        out[i, 1] = slope(s[i])
        out[i, 2] = rest(s[i])

    s = np.linspace(0.0, load_adhesion_law(name).reach, 40001)
    out = wp.zeros((len(s), 3), dtype=wp.float64, device="cpu")
    wp.launch(values, dim=len(s), inputs=[wp.array(s, dtype=wp.float64, device="cpu")], outputs=[out], device="cpu")
    t, dt, left = out.numpy().T
    assert np.trapezoid(t, s) == pytest.approx(1.0, abs=1e-4), "w is the work of parting"
    np.testing.assert_allclose(np.gradient(t, s)[1:-1], dt[1:-1], atol=2e-3)
    np.testing.assert_allclose(-np.gradient(left, s)[1:-1], t[1:-1], atol=2e-3)
    assert left[0] == 1.0 and left[-1] < 1e-4 and (t >= 0).all()


@pytest.mark.parametrize(
    ("name", "left"), [("exponential", np.exp(-0.3)), ("linear", 0.7**2), ("xu_needleman", 1.3 * np.exp(-0.3))]
)
def test_a_stiff_face_pulls_as_bradley_says(name, left):
    """A rigid sphere above a rigid plane: 2 pi R times the work left at that gap (Bradley, Phil. Mag. 13, 853)."""
    work, radius, length = 20.0, 10.0, 0.06
    skin = model(sticky(Adhesion(name, work, length), modulus=3000.0), cells=10, layers=2, residual=3e-6)
    [pull] = forces(skin, radius, [-0.3 * length])
    assert -pull == pytest.approx(2 * np.pi * work * 1e-3 * radius * left, rel=0.02)


def test_what_the_indenter_does_is_kept_as_energy():
    """No dissipation: the work along a path is the change of strain energy and of the attraction's potential."""
    skin = model(sticky(Adhesion("exponential", 5.0, 0.1)), cells=6, layers=2, residual=1e-5)
    request = PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, tuple(np.linspace(0.0, 0.2, 9)))
    batch = skin.skin.batch([request], 1)
    assert isinstance(skin.skin.surfaces([request])[0], AdhesiveSurface)
    kept, force = [], []
    press = skin.skin.placed(0, request)
    for _, _, found in batch.run([press], lambda found: [found]):
        [contact] = found.contacts
        kept.append(float(skin.skin.body.energy(found.u, press.conditions)[0] + contact.energy[0]))
        force.append(-float(contact.force[2, 0]))
    work = np.concatenate([[0.0], np.cumsum(np.diff(request.depths) * (np.array(force)[1:] + force[:-1]) / 2)])
    np.testing.assert_allclose(np.array(kept) - kept[0], work, atol=0.02 * abs(kept[0]))
    assert force[0] < 0 < force[-1], "it is pulled in where it just touches, and pushed back deeper"


def test_pull_off_lies_between_the_soft_and_the_stiff_limit():
    """JKR (Proc. R. Soc. A 324 (1971) 301): 1.5 pi w R; DMT (J. Colloid Interface Sci. 53 (1975) 314): 2 pi w R."""
    work, radius = 5.0, 2.0
    skin = model(sticky(Adhesion("exponential", work, 0.1)), cells=10)
    pull = -forces(skin, radius, [0.0, 0.05, 0.0, -0.04, -0.08]) / (np.pi * work * 1e-3 * radius)
    assert 1.5 < pull.max() < 2.0
    assert pull[2] == pytest.approx(pull[0], rel=0.01), "no jump in between: the way back is the way in"


def test_the_skin_lets_go_in_a_jump_and_is_then_at_rest():
    skin = model(sticky(Adhesion("linear", 10.0, 0.12)), cells=8, layers=2)
    request = PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.0, -0.13, -0.4))
    _, held, parted = (state for _, state in skin.states(request))
    assert -held.force[2] > np.pi * 10e-3 * 2.0 and held.displacement[:, 2].max() > 0.1, "a neck is drawn up"
    assert parted.force[2] == 0.0 and np.abs(parted.displacement).max() < 1e-4


def test_presses_of_a_batch_stick_each_for_itself():
    skin = model(sticky(Adhesion("exponential", 5.0, 0.1), friction=0.2), cells=6, layers=2)
    requests = [PressRequest(Sphere(2.0), x, 0.0, 0.0, (0.0, depth)) for x, depth in ((0.0, 0.1), (0.5, -0.05))]
    together: dict[int, list] = {0: [], 1: []}
    for number, _, state in skin.states_many(requests, capacity=2):
        together[number].append(state)
    for request, found in zip(requests, together.values(), strict=True):
        for (_, alone), state in zip(skin.states(request), found, strict=True):
            np.testing.assert_allclose(state.force, alone.force, atol=2e-3 * np.abs(alone.force).max() + 1e-5)
    solution = skin.solve(requests[0])
    assert solution.provenance["parameters"]["adhesion"] == {"law": "exponential", "work": 5.0, "range": 0.1}


def test_without_adhesion_there_is_none_and_a_sensor_keeps_its_hash():
    plain = sticky(None)
    assert "adhesion" not in plain.document["contact"]
    stuck = sticky(Adhesion("linear", 0.1, 0.02))
    assert stuck.content_hash != plain.content_hash
    assert Sensor.from_document(stuck.document, "again") == stuck
    with pytest.raises(SolveError, match="above a skin that does not stick"):
        check_press(PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.0, 0.1, -0.1)), plain)


def test_what_cannot_be_is_said():
    document = sticky(Adhesion("linear", 0.1, 0.02)).document
    document["contact"]["adhesion"]["work"] = -1.0
    with pytest.raises(FormatError, match=r"contact/adhesion/work: -1.0 is .*J/m\^2"):
        Sensor.from_document(document, "sensor.yaml")
    with pytest.raises(UsageError, match="exponential, linear, xu_needleman"):
        forces(model(sticky(Adhesion("glue", 0.1, 0.02)), cells=4, layers=2), 2.0, [0.1])
    skin = model(sticky(Adhesion("linear", 0.1, 0.02)), cells=4, layers=2)
    request = PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.0, 0.1))
    with pytest.raises(SolveError, match="sticks"):
        next(sensitivities(skin, request, ["x"]))


def test_a_mesh_too_coarse_for_the_law_is_named():
    coarse, request = Adhesion("linear", 0.1, 0.002), PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.0, 0.1))
    skin = model(sticky(coarse), cells=6, layers=2)
    assert "falls over 0.015 mm" in fineness.remark(skin.mesh, skin.sensor, request, (0.6, 0.6))
    wide = sticky(Adhesion("linear", 0.1, 0.05))
    assert fineness.remark(skin.mesh, wide, request, (0.6, 0.6)) == ""
