"""What every law must satisfy; a new file in the folder is held to it without a change here."""

from dataclasses import asdict

import numpy as np
import pytest
from skin_examples import random_rotation

from tacdata import registry
from tacdata.errors import FormatError, UsageError
from tacdata.sensor.sensor import Material
from tacdata.skin.materials import load_law
from tacdata.skin.materials.law import Gradient
from tacdata.skin.validity.law_evaluation import evaluate
from tacdata.warp_runtime import wp

LAWS = registry.names("tacdata.skin.materials", "law")
WITH_PARAMETERS = [n for n in LAWS if asdict(load_law(n))]
IDENTITY = np.eye(3)[None]


@pytest.fixture
def random():
    return np.random.default_rng(7)


def gradients(random, count=20):
    """Deformation gradients with stretches of some tens of per cent and J between 0.6 and 1.6."""
    F = IDENTITY + random.uniform(-0.35, 0.35, (40 * count, 3, 3))
    J = np.linalg.det(F)
    return F[(J > 0.6) & (J < 1.6)][:count]


def small_gradients(random, count=60):
    """Displacement gradients of the norm 1e-3: any, without volume change to first order, and pure swelling."""
    H = random.normal(size=(count, 3, 3))
    H[: count // 2] -= np.trace(H[: count // 2], axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    H[-5:] = np.eye(3)
    return 1e-3 * H / np.linalg.norm(H, axis=(1, 2), keepdims=True)


def plain(name):
    return Material(name, 0.30, 0.47)


def typical(name):
    return Material(name, 0.30, 0.47, asdict(type(load_law(name)).example()))


def values(material, F, dF=None, real: type = wp.float64, of: Gradient = "F"):
    law = load_law(material.law)
    return evaluate(law, law.parameters(material), F, dF, real, of)


@pytest.mark.parametrize("make", [plain, typical], ids=["plain", "typical"])
@pytest.mark.parametrize("name", LAWS)
class TestLaw:
    def test_the_undeformed_state_has_no_energy_and_no_stress(self, name, make):
        for real in (wp.float64, wp.float32):
            rest = values(make(name), IDENTITY, real=real)
            assert rest.energy[0] == 0
            assert np.abs(rest.stress).max() == 0

    def test_deformation_costs_energy(self, name, make, random):
        assert values(make(name), gradients(random)).energy.min() > 0

    def test_stress_is_the_derivative_of_energy(self, name, make, random):
        F, h = gradients(random), 1e-6
        dF = random.normal(size=F.shape)
        up, down = (values(make(name), F + s * h * dF).energy for s in (1, -1))
        stress = values(make(name), F).stress
        assert np.allclose((up - down) / (2 * h), np.einsum("nij,nij->n", stress, dF), atol=1e-8)

    def test_tangent_is_the_derivative_of_stress(self, name, make, random):
        F, h = gradients(random), 1e-6
        dF = random.normal(size=F.shape)
        up, down = (values(make(name), F + s * h * dF) for s in (1, -1))
        here = values(make(name), F, dF)
        assert np.allclose((up.stress - down.stress) / (2 * h), here.tangent, atol=1e-7)

    def test_tangent_is_symmetric(self, name, make, random):
        F = gradients(random)
        a, b = random.normal(size=(2, *F.shape))
        ab = np.einsum("nij,nij->n", b, values(make(name), F, a).tangent)
        ba = np.einsum("nij,nij->n", a, values(make(name), F, b).tangent)
        assert np.allclose(ab, ba, rtol=1e-10, atol=1e-12)

    def test_a_rotation_changes_nothing(self, name, make, random):
        F, Q = gradients(random), random_rotation(random)
        still, turned = values(make(name), F), values(make(name), Q @ F)
        assert np.allclose(turned.energy, still.energy, rtol=1e-10)
        assert np.allclose(turned.stress, Q @ still.stress, atol=1e-12)
        assert np.abs(values(make(name), Q[None]).stress).max() < 1e-14

    def test_the_material_has_no_direction(self, name, make, random):
        F, Q = gradients(random), random_rotation(random)
        assert np.allclose(values(make(name), F @ Q).energy, values(make(name), F).energy, rtol=1e-10)

    def test_small_strains_show_the_elastic_constants(self, name, make):
        material = make(name)
        shear = np.zeros((1, 3, 3))
        shear[0, 0, 1] = 1.0
        nu = material.poisson_ratio
        changes = np.concatenate([shear, IDENTITY, np.diag([1.0, -nu, -nu])[None]])
        of_shear, of_swelling, of_pull = values(material, np.repeat(IDENTITY, 3, axis=0), changes).tangent
        assert np.allclose(of_shear, material.shear_modulus * (shear[0] + shear[0].T), atol=1e-12)
        assert np.allclose(of_swelling, 3 * material.bulk_modulus * np.eye(3), atol=1e-12)
        assert np.allclose(of_pull, np.diag([material.youngs_modulus, 0, 0]), atol=1e-12)

    def test_single_precision_keeps_its_digits_at_small_strain(self, name, make, random):
        """From H relative to the exact answer; from F, whose own rounding counts, relative to that of the rounded F."""
        H = small_gradients(random)
        exact = values(make(name), H, of="H")
        of_h = values(make(name), H, real=wp.float32, of="H")
        rounded = (IDENTITY + H).astype(np.float32)
        of_f, exact_of_f = values(make(name), rounded, real=wp.float32), values(make(name), rounded.astype(float))
        for given, wanted in ((of_h, exact), (of_f, exact_of_f)):
            error, size = (np.linalg.norm(P, axis=(1, 2)) for P in (given.stress - wanted.stress, wanted.stress))
            assert (error < 1e-5 * size).all()
            assert np.abs(given.energy / wanted.energy - 1).max() < 1e-5

    def test_single_precision_follows_at_large_strain(self, name, make, random):
        F = gradients(random).astype(np.float32)
        dF = random.normal(size=F.shape).astype(np.float32)
        single, double = values(make(name), F, dF, real=wp.float32), values(make(name), F.astype(float), dF)
        assert np.allclose(single.energy, double.energy, rtol=2e-5)
        for quantity in ("stress", "tangent"):
            given, wanted = getattr(single, quantity), getattr(double, quantity)
            assert np.linalg.norm(given - wanted, axis=(1, 2)).max() < 1e-5 * np.linalg.norm(wanted, axis=(1, 2)).max()

    def test_a_state_turned_inside_out_has_no_stress(self, name, make):
        inverted = values(make(name), np.diag([1.0, 1.0, -0.5])[None])
        assert np.isnan(inverted.energy[0])
        assert np.isnan(inverted.stress).any()

    def test_the_same_functions_are_returned_at_every_call(self, name, make):
        law, again = load_law(name), load_law(name)
        for which in ("energy", "stress", "tangent"):
            function, other = (getattr(x, f"{which}_function") for x in (law, again))
            assert function() is other(wp.float64)
            assert function(wp.float32, "H") is other(wp.float32, "H")
            assert function() is not function(wp.float32)


@pytest.mark.parametrize("name", WITH_PARAMETERS)
class TestParameters:
    def test_their_defaults_are_neo_hookean(self, name, random):
        """So that a parameter can be an effect that is nothing at its default."""
        F = gradients(random)
        given, wanted = values(plain(name), F, F), values(plain("neo_hookean"), F, F)
        for quantity in ("energy", "stress", "tangent"):
            assert np.allclose(getattr(given, quantity), getattr(wanted, quantity), rtol=1e-9, atol=1e-12)

    def test_their_example_is_not(self, name, random):
        F = gradients(random)
        assert np.abs(values(typical(name), F).energy / values(plain(name), F).energy - 1).max() > 1e-3

    def test_a_wrong_name_is_refused_with_the_right_ones(self, name):
        known = next(iter(asdict(load_law(name))))
        with pytest.raises(FormatError, match=rf"sharre(.|\n)*{known}"):
            load_law(name).parameters(Material(name, 0.3, 0.47, {"sharre": 1.0}))

    @pytest.mark.parametrize("value", [float("nan"), float("inf"), "much", True, None, [[1.0]]], ids=repr)
    def test_what_is_no_number_is_refused(self, name, value):
        known = next(iter(asdict(load_law(name))))
        with pytest.raises(FormatError, match=rf"{name}: {known}(.|\n)*finite number"):
            load_law(name).parameters(Material(name, 0.3, 0.47, {known: value}))


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("mooney_rivlin", {"c01_share": 1.5}, "0 to 1"),
        ("mooney_rivlin", {"c01_share": [0.2, 0.3]}, "one finite number"),
        ("gent", {"stiffening": -0.1}, "0 to 10"),
        ("arruda_boyce", {"inverse_links": 4}, "0 to 1"),
        ("ogden", {"exponent": 2.0}, "a list of"),
        ("ogden", {"exponent": [2, -2]}, "2 exponents and 1 shares"),
        ("ogden", {"exponent": [2, 0], "share": [0.5, 0.5]}, "0.1 to 30"),
        ("ogden", {"exponent": [2, 4], "share": [0.5, -0.7]}, "add up to -0.2"),
        ("ogden", {"exponent": [1, 2, 3, 4], "share": [0.25] * 4}, "1 to 3"),
        ("neo_hookean", {"c01_share": 0.2}, "only Young's modulus"),
    ],
)
def test_parameters_that_make_no_material_are_refused(name, parameters, words):
    with pytest.raises(FormatError, match=words):
        load_law(name).parameters(Material(name, 0.3, 0.47, parameters))


def test_an_unknown_law_is_refused_with_the_known_ones():
    with pytest.raises(UsageError, match=r"neo_hookean_lag(.|\n)*neo_hookean_log"):
        load_law("neo_hookean_lag")


def test_the_two_neo_hookean_forms_differ_under_confined_compression():
    """The choice of the volumetric form is no detail: labels name it."""
    F = np.diag([0.85, 1.0, 1.0])[None]
    split, log = (values(plain(n), F).energy[0] for n in ("neo_hookean", "neo_hookean_log"))
    assert abs(split / log - 1) > 0.02
