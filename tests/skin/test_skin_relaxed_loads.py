"""Loads at real speed from a slow path: closed forms of relaxation and of contacts that shrink, and what is assumed."""

from dataclasses import replace

import numpy as np
import pytest
from skin_examples import box_mesh, slab_sensor

from tacdata.errors import UsageError
from tacdata.indenters.sphere import Sphere
from tacdata.labels import PathSolution
from tacdata.sensor.material import PronyTerm
from tacdata.skin.constitutive.prony import Prony
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.relaxed_loads import instantaneous, relaxed_loads

PRONY = Prony((0.2, 0.15), (0.1, 2.0))


def hertz_path(depths=np.linspace(0.0, 1.0, 41)):
    """A path whose loads are depth^1.5 upright, and half that on one protrusion."""
    n, up = len(depths), depths**1.5
    zero = np.zeros((n, 1, 1))
    force = np.stack([0 * up, 0 * up, up], axis=-1)
    return PathSolution(
        depths, zero, 0.5 * up[:, None], zero[:, 0], zero[:, 0], force, zero, 0 * up, zero[:, 0], 0 * up, 0 * up, {}
    )


def test_a_slow_press_is_the_path_itself():
    time, depth = np.linspace(0, 1e6, 51), np.interp(np.linspace(0, 2, 51), [0, 1, 2], [0, 0.8, 0])
    found = relaxed_loads(time, depth, hertz_path(), PRONY)
    assert found.force[:, 2] == pytest.approx(depth**1.5, abs=2e-4)
    assert found.taxel_force[:, 0] == pytest.approx(0.5 * found.force[:, 2])
    assert found.contact_depth == pytest.approx(depth, abs=1e-4)


def test_a_held_press_relaxes_by_the_series():
    """A sudden press: F(t)/F(0+) = G(t)/G0 = g_inf + sum g_i exp(-t/tau_i)."""
    time = np.concatenate([[0.0, 1e-7], np.geomspace(1e-3, 50, 40)])
    found = relaxed_loads(time, np.where(time > 0, 0.6, 0.0), hertz_path(), PRONY).force[1:, 2]
    decay = 1 - sum(g * (1 - np.exp(-time[1:] / tau)) for g, tau in zip(PRONY.shares, PRONY.times, strict=True))
    assert found[0] == pytest.approx(0.6**1.5 * PRONY.instantaneous_ratio, rel=1e-5)
    assert found / found[0] == pytest.approx(decay, rel=1e-5)


def test_a_ramp_is_the_hereditary_integral():
    """F(t) = int psi(t - s) 1.5 sqrt(v s) v ds, by another quadrature."""
    v, t = 2.0, 0.4
    s = np.linspace(0, t, 200001)
    expected = np.trapezoid(PRONY.relaxation(t - s) * 1.5 * np.sqrt(v * s) * v, s)
    found = relaxed_loads(np.array([0.0, t]), np.array([0.0, v * t]), hertz_path(np.linspace(0, 1, 401)), PRONY)
    assert found.force[1, 2] == pytest.approx(expected, rel=1e-4)


def test_faster_is_stiffer():
    depth = np.array([0.0, 0.5])
    ends = (0.01, 0.1, 1.0, 10.0, 1e3)
    forces = [relaxed_loads(np.array([0.0, t]), depth, hertz_path(), PRONY).force[1, 2] for t in ends]
    assert np.all(np.diff(forces) < 0)
    assert forces[0] < 0.5**1.5 * PRONY.instantaneous_ratio


def test_a_quick_release_opens_the_contact_early():
    """After a long hold the skin comes back more slowly than a sudden release: force gone at 35 % of the depth.

    Ting: the contact is lost where int psi d depth = 0 over the whole past, here D - D psi(0+) + psi(0+) d = 0, so that
    d = D (1 - G_inf/G0).
    """
    time = np.array([0.0, 1.0, 1e4, *(1e4 + np.linspace(1e-6, 1e-4, 101))])
    depth = np.array([0.0, 0.6, 0.6, *(0.6 * np.linspace(0.99, 0, 101))])
    found = relaxed_loads(time, depth, hertz_path(), PRONY)
    open_from = depth[np.flatnonzero(found.force[2:, 2] <= 1e-9)[0] + 2]
    assert open_from == pytest.approx(0.6 * 0.35, abs=0.01)
    assert found.force[:, 2].min() >= 0
    assert np.all(np.diff(found.force[2:, 2]) <= 1e-12)
    assert found.contact_depth[-1] == 0


@pytest.mark.parametrize(
    ("time", "depth", "words"),
    [
        ([0, 1, 1], [0, 0.1, 0.2], "rising"),
        ([0, 1, 2, 3], [0, 0.5, 0.1, 0.4], "rises again"),
        ([0, 1], [0, 1.5], "deep"),
        ([0, float("nan")], [0, 0.1], "finite"),
    ],
)
def test_courses_that_cannot_be_followed_are_refused(time, depth, words):
    with pytest.raises(UsageError, match=words):
        relaxed_loads(np.array(time, dtype=float), np.array(depth), hertz_path(), PRONY)


def test_what_one_function_for_all_stress_costs():
    """A sudden press by two solutions of the model: the bulk modulus does not relax, so the skin stiffens by less.

    Of a rise of the shear modulus by 43 %; forces still scale by one factor at all depths to 1.5 %, and the map hardly
    changes: it is the elastic one at any speed.
    """
    sensor = slab_sensor()
    material = replace(sensor.material, prony=(PronyTerm(0.3, 1.0),))
    depths, answers = (0.1, 0.3, 0.5), []
    for now in (material, instantaneous(material)):
        own = replace(sensor, material=replace(now, prony=()))
        model = SkinModel(own, ModelSettings(error_estimate=False, averaged_from=0.0), mesh=box_mesh(sensor, 5, 5, 2))
        answers.append(model.solve(PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, depths)))
    slow, sudden = answers
    factor = sudden.force[:, 2] / slow.force[:, 2]
    maps = [float(np.sqrt(((sudden.surface - slow.surface)[k] ** 2).mean()) / d) for k, d in enumerate(depths)]
    print("stiffening", factor.round(4), "of", 1 / 0.7, "map rms over depth", np.round(maps, 5))
    assert np.all((1.2 < factor) & (factor < 1 / 0.7))
    assert np.ptp(factor) < 0.015
    assert max(maps) < 0.005
    found = relaxed_loads(
        np.array([0.0, 1e-9]), np.array([0.0, 0.3]), slow, Prony.of(material), float(factor[2])
    ).force[1, 2]
    assert found == pytest.approx(sudden.force[1, 2], rel=0.01)
