"""A material point that relaxes: closed forms, limits of rate, order in the time step, and no energy from nowhere."""

from functools import cache

import numpy as np
import pytest
import torch
import warp as wp

from tacdata.sensor import Material, PronyTerm
from tacdata.skin.constitutive import kinematics
from tacdata.skin.constitutive.prony import Prony
from tacdata.skin.materials import load_law
from tacdata.skin.relaxing_law import relaxing_functions

TERMS = (PronyTerm(0.2, 0.1), PronyTerm(0.1, 2.0))
IDENTITY = np.eye(3)


def material(law="neo_hookean", terms=TERMS):
    return Material(law, 0.30, 0.47, prony=terms)


@cache
def kernel(kind, real):
    mat33, numbers = kinematics.matrix(real), kinematics.parameters(real)
    stress_of, tangent_of, branch_of = relaxing_functions(kind, real)

    @wp.kernel(module="unique", enable_backward=False)
    def values(
        H: wp.array(dtype=mat33),
        D: wp.array(dtype=mat33),
        a: real,
        S_h: wp.array(dtype=mat33),
        m: numbers,
        stress: wp.array(dtype=mat33),
        tangent: wp.array(dtype=mat33),
        branch: wp.array(dtype=mat33),
    ):
        i = wp.tid()
        stress[i] = stress_of(H[i], a, S_h[i], m)
        tangent[i] = tangent_of(H[i], D[i], a, S_h[i], m)
        branch[i] = branch_of(H[i], m)

    return values


class Point:
    """Material points that are led along given deformations."""

    def __init__(self, of, count=1, real: type = wp.float64):
        self.prony, self.real = Prony.of(of), real
        law = load_law(of.law)
        numbers = law.parameters(of)
        self._m = kinematics.parameters(real)(*numbers, *([0.0] * (8 - len(numbers))))
        self._kernel, self._mat = kernel(type(law), real), kinematics.matrix(real)
        self.history = self.prony.start(np.zeros((count, 3, 3)))

    def evaluate(self, F, duration, dF=None):
        """Stress, tangent along dF and long-term branch stress after a step; the history stays as it is."""
        step = self.prony.step(duration)
        stored = self.prony.stored_stress(step, self.history)
        inputs = [
            wp.array(np.ascontiguousarray(a), dtype=self._mat, device="cpu")
            for a in (F - IDENTITY, F if dF is None else dF, stored)
        ]
        outputs = [wp.zeros(len(F), dtype=self._mat, device="cpu") for _ in range(3)]
        amplification = self.real(step.amplification)
        wp.launch(
            self._kernel,
            dim=len(F),
            inputs=[inputs[0], inputs[1], amplification, inputs[2], self._m],
            outputs=outputs,
            device="cpu",
        )
        return [a.numpy().astype(float) for a in outputs]

    def advance(self, F, duration):
        """Stress after a step, which is accepted."""
        stress, _, branch = self.evaluate(F, duration)
        self.history = self.prony.advance(self.prony.step(duration), self.history, branch)
        return stress


def elastic(F, law="neo_hookean", prony=()):
    """Stress and isochoric stress of the law without relaxation."""
    point = Point(material(law, prony), len(F))
    stress, _, branch = point.evaluate(F, 1.0)
    return stress, F @ branch


def pulled(stretch, volume=1.02):
    lateral = np.sqrt(volume / stretch)
    return np.stack([np.diag([s, w, w]) for s, w in zip(np.atleast_1d(stretch), np.atleast_1d(lateral), strict=True)])


def test_the_series_names_both_moduli():
    prony = Prony.of(material())
    assert prony.instantaneous_ratio == pytest.approx(1 / 0.7)
    time = np.array([0.0, 0.05, 1.0, 1e9])
    wanted = (1 - 0.2 * (1 - np.exp(-time / 0.1)) - 0.1 * (1 - np.exp(-time / 2.0))) / 0.7
    assert np.allclose(prony.relaxation(time), wanted)
    assert Prony.of(material(terms=())).instantaneous_ratio == 1
    assert Prony.of(material(terms=())).relaxation(time) == pytest.approx(np.ones(4))


@pytest.mark.parametrize("law", ["neo_hookean", "neo_hookean_log", "mooney_rivlin", "ogden"])
def test_a_sudden_strain_relaxes_by_the_closed_form(law):
    """P(t) = P_vol + G(t)/G_inf P_iso at any strain, whatever the time steps."""
    F = pulled(1.6)
    whole, isochoric = elastic(F, law)
    point = Point(material(law))
    time = np.cumsum([0.0, 0.003, 0.05, 0.2, 1.0, 5.0, 100.0])
    for duration, ratio in zip(np.diff(time, prepend=0.0), Prony.of(material()).relaxation(time), strict=True):
        assert np.allclose(point.advance(F, duration), whole + (ratio - 1) * isochoric, atol=1e-13)


def test_slow_loading_meets_the_stated_modulus_and_sudden_loading_the_instantaneous_one():
    """A small pull with free sides: E slowly, and suddenly that of G0 with the same bulk modulus."""
    of, strain = material(), 1e-6
    kappa, sudden_mu = of.bulk_modulus, of.shear_modulus / 0.7
    sudden = 9 * kappa * sudden_mu / (3 * kappa + sudden_mu)
    for duration, modulus in ((0.0, sudden), (1e-9, sudden), (np.inf, of.youngs_modulus), (1e9, of.youngs_modulus)):
        nu = (3 * kappa - modulus) / (6 * kappa)
        F = IDENTITY[None] + strain * np.diag([1.0, -nu, -nu])
        stress = Point(of).advance(F, duration)[0]
        assert stress[0, 0] / strain == pytest.approx(modulus, rel=1e-5)
        assert abs(stress[1, 1]) < 1e-5 * stress[0, 0]


def test_a_ramp_is_integrated_exactly_at_small_strain():
    """Constant rate: Q_i = beta_i tau_i dS/dt (1 - exp(-t/tau_i)), with one step or many."""
    of, rate, end = material(), 1e-7, 3.0
    prony = Prony.of(of)
    D = np.diag([1.0, -0.5, -0.5])
    taus = np.array(prony.times)
    lag = np.sum(np.array(prony.strengths) * taus * (1 - np.exp(-end / taus)))
    wanted = 2 * of.shear_modulus * rate * (end + lag) * D
    for steps in (1, 7):
        point = Point(of)
        for k in range(1, steps + 1):
            stress = point.advance(IDENTITY[None] + rate * end * k / steps * D, end / steps)
        assert np.allclose(stress[0], wanted, atol=1e-6 * wanted.max())


def test_the_error_falls_with_the_square_of_the_time_step():
    """A large smooth motion with rotation; the reference takes 2048 steps."""

    def motion(t):
        stretch = 1 + 0.4 * np.sin(2.1 * t) ** 2
        shear = np.eye(3)
        shear[0, 1] = 0.5 * np.sin(1.3 * t)
        c, s = np.cos(t), np.sin(t)
        return (np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ shear @ pulled(stretch)[0])[None]

    def final(steps):
        point = Point(material())
        stress = point.advance(motion(0.0), 0.0)
        for t in np.linspace(0, 2.0, steps + 1)[1:]:
            stress = point.advance(motion(t), 2.0 / steps)
        return stress

    fine = final(2048)
    errors = np.array([np.abs(final(n) - fine).max() for n in (16, 32, 64, 128)])
    rates = np.log2(errors[:-1] / errors[1:])
    assert (rates > 1.85).all() and (rates < 2.2).all()


def test_a_rotation_of_the_observer_turns_the_stress_and_nothing_else():
    random = np.random.default_rng(3)
    still, turned = Point(material()), Point(material())
    for k in range(1, 6):
        F = (IDENTITY + 0.1 * k * random.uniform(-0.4, 0.4, (3, 3)))[None]
        Q = np.linalg.qr(random.normal(size=(3, 3)))[0]
        Q *= np.linalg.det(Q)
        assert np.allclose(turned.advance(Q @ F, 0.3), Q @ still.advance(F, 0.3), atol=1e-13)


@pytest.mark.parametrize("law", ["neo_hookean", "neo_hookean_log", "ogden"])
def test_the_tangent_is_the_derivative_of_the_stress_within_a_step_and_symmetric(law):
    random, h = np.random.default_rng(4), 1e-6
    F = IDENTITY + random.uniform(-0.15, 0.15, (12, 3, 3))
    point = Point(material(law), 12)
    point.advance(IDENTITY + random.uniform(-0.15, 0.15, (12, 3, 3)), 0.2)
    a, b = random.normal(size=(2, 12, 3, 3))
    up, down = (point.evaluate(F + s * h * a, 0.3)[0] for s in (1, -1))
    along_a, along_b = (point.evaluate(F, 0.3, d)[1] for d in (a, b))
    assert np.allclose((up - down) / (2 * h), along_a, atol=1e-8)
    assert np.allclose((along_a * b).sum(axis=(1, 2)), (along_b * a).sum(axis=(1, 2)), rtol=1e-10)


@pytest.mark.parametrize("amplitude", [0.02, 0.3])
def test_closed_cycles_cost_work(amplitude):
    """Any closed path from rest and long after: the work done is what was dissipated, and never negative."""
    random = np.random.default_rng(6)
    count, steps, period = 24, 160, np.geomspace(0.01, 100.0, 24)
    modes = random.normal(size=(2, 3, count, 3, 3))
    modes *= amplitude / np.abs(modes).sum(axis=(0, 1)).max(axis=(1, 2))[:, None, None]
    for p in (0, 8, 16, 23):
        point = Point(material(), count)
        work, before, stress = np.zeros(count), np.repeat(IDENTITY[None], count, 0), np.zeros((count, 3, 3))
        for t in np.linspace(0, 1, steps + 1)[1:]:
            waves = [np.sin(2 * np.pi * t), 1 - np.cos(2 * np.pi * t)]
            F = IDENTITY + sum(w * np.sin(np.pi * t) ** k * modes[i, k] for i, w in enumerate(waves) for k in range(3))
            after = point.advance(F, period[p] / steps)
            work += ((after + stress) / 2 * (F - before)).sum(axis=(1, 2))
            before, stress = F, after
        assert np.allclose(before, IDENTITY, atol=1e-12)
        scale = material().shear_modulus * amplitude**2
        assert (work > 0).all()
        assert work.max() > 1e-3 * scale


def test_work_of_a_cycle_is_the_dissipated_energy():
    """At small strain the branches' dissipation, integrated, is the area of the loop."""
    of, strain, steps = material(), 1e-4, 4000
    point, D = Point(of), np.diag([1.0, -0.5, -0.5])
    work = lost = 0.0
    before, stress, rate = IDENTITY, np.zeros((3, 3)), 0.0
    for t in np.linspace(0, 1.0, steps + 1)[1:]:
        F = IDENTITY + strain * np.sin(np.pi * t) ** 2 * D
        after = point.advance(F[None], 1.0 / steps)[0]
        now = float(point.prony.dissipation(point.history, of.shear_modulus)[0])
        assert now >= 0
        work += ((after + stress) / 2 * (F - before)).sum()
        lost += (now + rate) / 2 / steps
        before, stress, rate = F, after, now
    left = sum(
        float((q**2).sum()) / (4 * b * of.shear_modulus)
        for q, b in zip(point.history.branches, point.prony.strengths, strict=True)
    )
    assert work == pytest.approx(lost + left, rel=2e-3)


def test_what_has_rested_at_a_strain_carries_no_branch_stress():
    F = pulled(1.3)
    point = Point(material())
    whole, _ = elastic(F)
    _, _, branch = point.evaluate(F, 0.0)
    point.history = point.prony.start(branch)
    assert np.allclose(point.advance(F, 0.01), whole, atol=1e-14)


def test_histories_may_live_in_torch():
    of, F = material(), pulled(1.4)
    arrays, tensors = Point(of), Prony.of(of)
    history = tensors.start(torch.zeros(1, 3, 3, dtype=torch.float64))
    for duration in (0.0, 0.1, 1.0):
        _, _, branch = arrays.evaluate(F, duration)
        arrays.advance(F, duration)
        step = tensors.step(duration)
        history = tensors.advance(step, history, torch.as_tensor(branch))
        stored = tensors.stored_stress(step, history)
        assert isinstance(stored, torch.Tensor)
        assert np.allclose(stored.numpy(), arrays.prony.stored_stress(step, arrays.history), atol=1e-15)


def test_single_precision_follows():
    of, F = material(), pulled(1.001, volume=1.0)
    double, single = Point(of), Point(of, real=wp.float32)
    for duration in (0.0, 0.1, 1.0):
        wanted, given = double.advance(F, duration), single.advance(F, duration)
        assert np.linalg.norm(given - wanted) < 1e-4 * np.linalg.norm(wanted)


def test_a_step_back_in_time_is_refused():
    with pytest.raises(ValueError, match=r"-0\.1 s"):
        Prony.of(material()).step(-0.1)
    with pytest.raises(ValueError, match="nan"):
        Prony.of(material()).step(float("nan"))
