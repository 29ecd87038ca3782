"""What every law must satisfy; a new file in the folder is held to it without a change here."""

import numpy as np
import pytest
from skin_examples import evaluate, random_rotation

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.sensor.sensor import Material
from tacdata.skin.materials import load_law

LAWS = registry.names("tacdata.skin.materials", "law")
IDENTITY = np.eye(3)[None]


@pytest.fixture
def random():
    return np.random.default_rng(7)


def gradients(random, count=20):
    """Deformation gradients with stretches of some tens of per cent and J between 0.6 and 1.6."""
    F = IDENTITY + random.uniform(-0.35, 0.35, (40 * count, 3, 3))
    J = np.linalg.det(F)
    return F[(J > 0.6) & (J < 1.6)][:count]


def material(law):
    return Material(law, 0.30, 0.47)


@pytest.mark.parametrize("name", LAWS)
class TestLaw:
    def test_the_undeformed_state_has_no_energy_and_no_stress(self, name):
        energy, stress, _ = evaluate(load_law(name), material(name), IDENTITY, IDENTITY)
        assert abs(energy[0]) < 1e-14
        assert np.abs(stress).max() < 1e-14

    def test_deformation_costs_energy(self, name, random):
        F = gradients(random)
        assert evaluate(load_law(name), material(name), F, F)[0].min() > 0

    def test_stress_is_the_derivative_of_energy(self, name, random):
        law, F, h = load_law(name), gradients(random), 1e-6
        dF = random.normal(size=F.shape)
        up, down = (evaluate(law, material(name), F + s * h * dF, dF)[0] for s in (1, -1))
        stress = evaluate(law, material(name), F, dF)[1]
        assert np.allclose((up - down) / (2 * h), np.einsum("nij,nij->n", stress, dF), atol=1e-8)

    def test_tangent_is_the_derivative_of_stress(self, name, random):
        law, F, h = load_law(name), gradients(random), 1e-6
        dF = random.normal(size=F.shape)
        up, down = (evaluate(law, material(name), F + s * h * dF, dF)[1] for s in (1, -1))
        assert np.allclose((up - down) / (2 * h), evaluate(law, material(name), F, dF)[2], atol=1e-7)

    def test_tangent_is_symmetric(self, name, random):
        law, F = load_law(name), gradients(random)
        a, b = random.normal(size=(2, *F.shape))
        ab = np.einsum("nij,nij->n", b, evaluate(law, material(name), F, a)[2])
        ba = np.einsum("nij,nij->n", a, evaluate(law, material(name), F, b)[2])
        assert np.allclose(ab, ba, rtol=1e-10, atol=1e-12)

    def test_a_rotation_changes_nothing(self, name, random):
        law, F = load_law(name), gradients(random)
        Q = random_rotation(random)
        energy, stress, _ = evaluate(law, material(name), F, F)
        turned_energy, turned_stress, _ = evaluate(law, material(name), Q @ F, F)
        assert np.allclose(turned_energy, energy, rtol=1e-10)
        assert np.allclose(turned_stress, Q @ stress, atol=1e-12)

    def test_the_material_has_no_direction(self, name, random):
        law, F = load_law(name), gradients(random)
        Q = random_rotation(random)
        assert np.allclose(
            evaluate(law, material(name), F @ Q, F)[0], evaluate(law, material(name), F, F)[0], rtol=1e-10
        )

    def test_small_strains_show_the_elastic_constants(self, name):
        shear = np.zeros((1, 3, 3))
        shear[0, 0, 1] = 1.0
        of_shear = evaluate(load_law(name), material(name), IDENTITY, shear)[2][0]
        of_swelling = evaluate(load_law(name), material(name), IDENTITY, IDENTITY)[2][0]
        mu, kappa = material(name).shear_modulus, material(name).bulk_modulus
        assert np.allclose(of_shear, mu * (shear[0] + shear[0].T), atol=1e-12)
        assert np.allclose(of_swelling, 3 * kappa * np.eye(3), atol=1e-12)


def test_an_unknown_law_is_refused_with_the_known_ones():
    with pytest.raises(UsageError, match=r"neo_hookean_lag(.|\n)*neo_hookean_log"):
        load_law("neo_hookean_lag")


def test_the_two_neo_hookean_forms_differ_under_confined_compression():
    """The choice of the volumetric form is no detail: labels name it."""
    F = np.diag([0.85, 1.0, 1.0])[None]
    split, log = (evaluate(load_law(n), material(n), F, F)[0][0] for n in ("neo_hookean", "neo_hookean_log"))
    assert abs(split / log - 1) > 0.02
