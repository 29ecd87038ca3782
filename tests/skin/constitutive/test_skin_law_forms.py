"""The laws against the closed forms of textbooks, on incompressible paths, and against each other."""

from dataclasses import asdict

import numpy as np
import pytest

from tacdata import registry
from tacdata.sensor.sensor import Material
from tacdata.skin.constitutive import kinematics
from tacdata.skin.materials import load_law
from tacdata.skin.validity.law_evaluation import evaluate
from tacdata.warp_runtime import wp

MU = 0.3 / (2 * 1.47)
STRETCH = np.array([0.5, 0.7, 0.9, 1.1, 1.5, 2.0])
SHEAR = np.array([-1.5, -0.5, 0.2, 0.8, 2.0])
JM, LINKS, C01 = 20.0, 6.0, 0.3
EXPONENT, SHARE = (1.3, 5.0, -2.0), (0.9, 0.02, 0.08)
YEOH = (-0.04, 0.003)


def arruda_boyce_slope(x):
    """W'(I1) of the eight-chain series, its modulus by the published expansion of the initial shear modulus."""
    n = 1 / LINKS
    mu0 = MU / (1 + 3 / 5 * n + 99 / 175 * n**2 + 513 / 875 * n**3 + 42039 / 67375 * n**4)
    I = x + 3  # noqa: E741
    terms = (1 / 2, 2 * I * n / 20, 11 * 3 * I**2 * n**2 / 1050, 19 * 4 * I**3 * n**3 / 7000)
    return mu0 * (sum(terms) + 519 * 5 * I**4 * n**4 / 673750)


FIRST_INVARIANT = {
    "neo_hookean": ({}, lambda x: MU / 2 + 0 * x),
    "yeoh": (
        {"c2_over_c1": YEOH[0], "c3_over_c1": YEOH[1]},
        lambda x: MU / 2 * (1 + 2 * YEOH[0] * x + 3 * YEOH[1] * x**2),
    ),
    "gent": ({"stiffening": 1 / JM}, lambda x: MU / 2 * JM / (JM - x)),
    "arruda_boyce": ({"inverse_links": 1 / LINKS}, arruda_boyce_slope),
}
"""Law -> its parameters and dW/dI1 [MPa] as a function of I1 - 3."""


def values(name, parameters, F, dF=None, real: type = wp.float64, nu=0.47):
    law = load_law(name)
    return evaluate(law, law.parameters(Material(name, 2 * MU * (1 + nu), nu, parameters)), F, dF, real)


def pulled(name, parameters, stretches):
    """Nominal stress [MPa] along the first axis of an incompressible body, the third face free."""
    P = values(name, parameters, stretches[:, :, None] * np.eye(3)).stress
    true = stretches * np.einsum("nii->ni", P)
    return (true[:, 0] - true[:, 2]) / stretches[:, 0]


def sheared(name, parameters):
    F = np.eye(3) + SHEAR[:, None, None] * np.eye(3)[:, :, None][0] * np.eye(3)[1]
    return values(name, parameters, F).stress[:, 0, 1]


def uniaxial():
    return np.stack([STRETCH, STRETCH**-0.5, STRETCH**-0.5], axis=-1)


def equibiaxial():
    return np.stack([STRETCH, STRETCH, STRETCH**-2], axis=-1)


@pytest.mark.parametrize("name", FIRST_INVARIANT)
def test_laws_of_the_first_invariant(name):
    parameters, slope = FIRST_INVARIANT[name]
    x = STRETCH**2 + 2 / STRETCH - 3
    assert np.allclose(pulled(name, parameters, uniaxial()), 2 * slope(x) * (STRETCH - STRETCH**-2), rtol=1e-10)
    x = 2 * STRETCH**2 + STRETCH**-4 - 3
    assert np.allclose(pulled(name, parameters, equibiaxial()), 2 * slope(x) * (STRETCH - STRETCH**-5), rtol=1e-10)
    assert np.allclose(sheared(name, parameters), 2 * slope(SHEAR**2) * SHEAR, rtol=1e-10)


def test_mooney_rivlin():
    c10, c01, parameters = (1 - C01) * MU / 2, C01 * MU / 2, {"c01_share": C01}
    single = 2 * (STRETCH - STRETCH**-2) * (c10 + c01 / STRETCH)
    double = 2 * (STRETCH - STRETCH**-5) * (c10 + c01 * STRETCH**2)
    assert np.allclose(pulled("mooney_rivlin", parameters, uniaxial()), single, rtol=1e-10)
    assert np.allclose(pulled("mooney_rivlin", parameters, equibiaxial()), double, rtol=1e-10)
    assert np.allclose(sheared("mooney_rivlin", parameters), MU * SHEAR, rtol=1e-10)


def test_ogden():
    parameters = {"exponent": EXPONENT, "share": SHARE}
    pairs = list(zip(EXPONENT, SHARE, strict=True))
    single = sum(2 * MU * s / a * (STRETCH ** (a - 1) - STRETCH ** (-a / 2 - 1)) for a, s in pairs)
    double = sum(2 * MU * s / a * (STRETCH ** (a - 1) - STRETCH ** (-2 * a - 1)) for a, s in pairs)
    stretch = SHEAR / 2 + np.sqrt(1 + SHEAR**2 / 4)
    shear = sum(2 * MU * s / a * (stretch**a - stretch**-a) for a, s in pairs) / (stretch + 1 / stretch)
    assert np.allclose(pulled("ogden", parameters, uniaxial()), single, rtol=1e-10)
    assert np.allclose(pulled("ogden", parameters, equibiaxial()), double, rtol=1e-10)
    assert np.allclose(sheared("ogden", parameters), shear, rtol=1e-10)


def test_the_logarithmic_form():
    J = STRETCH
    nu = 0.47
    lame = 2 * MU * nu / (1 - 2 * nu)
    P = values("neo_hookean_log", {}, np.stack([np.diag([s, 1.0, 1.0]) for s in STRETCH])).stress
    assert np.allclose(P[:, 0, 0], MU * (J - 1 / J) + lame * np.log(J) / J, rtol=1e-10)
    assert np.allclose(sheared("neo_hookean_log", {}), MU * SHEAR, rtol=1e-10)


@pytest.mark.parametrize("name", ["neo_hookean", "yeoh", "mooney_rivlin", "ogden"])
def test_swelling_meets_the_bulk_modulus_alone(name):
    kappa = 2 * MU * 1.47 / (3 * 0.06)
    J = np.array([0.7, 0.95, 1.2])
    F = np.cbrt(J)[:, None, None] * np.eye(3)
    parameters, pressure = asdict(type(load_law(name)).example()), kappa * (J - 1) * np.cbrt(J) ** 2
    assert np.allclose(values(name, parameters, F).stress, pressure[:, None, None] * np.eye(3))


@pytest.mark.parametrize("real", [wp.float64, wp.float32], ids=["double", "single"])
@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-8, 1e-5, 1e-3, 0.1])
def test_ogden_with_two_powers_is_mooney_rivlin_also_where_stretches_meet(apart, real):
    """The same law by eigenvalues and without them: stress and tangent, two stretches or all three being equal."""
    random = np.random.default_rng(5)
    Q, dF = np.linalg.qr(random.normal(size=(40, 3, 3)))[0], random.normal(size=(40, 3, 3))
    base = np.where(np.arange(40)[:, None] % 2, [1.3, 1.3, 0.8], [1.1, 1.1, 1.1]) + apart * random.normal(size=(40, 3))
    F = np.einsum("nij,nj,nkj->nik", Q, base, np.roll(Q, 1, axis=0))
    F *= np.sign(np.linalg.det(F))[:, None, None]
    scalar = np.float64 if real is wp.float64 else np.float32
    F, dF = F.astype(scalar), dF.astype(scalar)
    ogden = values("ogden", {"exponent": (2.0, -2.0), "share": (0.75, 0.25)}, F, dF, real)
    mooney = values("mooney_rivlin", {"c01_share": 0.25}, F.astype(float), dF.astype(float))
    allowed = 1e-11 if real is wp.float64 else 2e-5
    assert np.abs(ogden.energy - mooney.energy).max() < allowed
    assert np.abs(ogden.stress - mooney.stress).max() < allowed
    assert np.abs(ogden.tangent - mooney.tangent).max() < 10 * allowed


def test_gent_beyond_its_pole_is_stiff_and_finite():
    """An iterate of a solver may get there: energy, stress and tangent go on without a jump."""
    stretch = np.linspace(1.0, 2.5, 3001)
    F = np.stack([stretch, stretch**-0.5, stretch**-0.5], axis=-1)[:, :, None] * np.eye(3)
    x = stretch**2 + 2 / stretch - 3
    found = values("gent", {"stiffening": 0.5}, F)
    assert x.max() > 2.0 / 0.5 * 0.9
    assert np.isfinite(found.energy).all() and np.isfinite(found.stress).all()
    true = np.diff(found.energy) / np.diff(stretch)
    P, mid = np.einsum("nii->ni", found.stress), 0.5
    slope = P[:, 0] - stretch**-1.5 * P[:, 1]
    assert np.allclose(true, mid * (slope[1:] + slope[:-1]), rtol=2e-3, atol=1e-6)
    assert (np.diff(slope) > 0).all()


@pytest.mark.parametrize("real", [wp.float64, wp.float32], ids=["double", "single"])
def test_functions_of_the_deformation_gradient_are_those_of_the_displacement_gradient(real):
    """Element kernels may hand in either."""
    mat33, numbers, law = kinematics.matrix(real), kinematics.parameters(real), load_law("mooney_rivlin")
    energy_of, stress_of, tangent_of = law.energy_function(real), law.stress_function(real), law.tangent_function(real)

    @wp.kernel(module="unique", enable_backward=False)
    def of_deformation(
        F: wp.array(dtype=mat33),
        m: numbers,
        W: wp.array(dtype=real),
        P: wp.array(dtype=mat33),
        T: wp.array(dtype=mat33),
    ):
        i = wp.tid()
        W[i] = energy_of(F[i], m)
        P[i] = stress_of(F[i], m)
        T[i] = tangent_of(F[i], F[i], m)

    F = np.eye(3) + np.random.default_rng(1).uniform(-0.3, 0.3, (20, 3, 3))
    F = F.astype(np.float64 if real is wp.float64 else np.float32)
    m = law.parameters(Material("mooney_rivlin", 0.3, 0.47, {"c01_share": 0.4}))
    found = [wp.zeros(20, dtype=t, device="cpu") for t in (real, mat33, mat33)]
    wp.launch(
        of_deformation,
        20,
        [wp.array(F, dtype=mat33, device="cpu"), numbers(*m, *[0.0] * (8 - len(m)))],
        found,
        device="cpu",
    )
    wanted = evaluate(law, m, F, F, real)
    for a, b in zip(found, (wanted.energy, wanted.stress, wanted.tangent), strict=True):
        assert np.array_equal(a.numpy(), b)


@pytest.mark.gpu
@pytest.mark.parametrize("name", registry.names("tacdata.skin.materials", "law"))
def test_the_gpu_says_the_same(name):
    """In both precisions; single keeps its digits at small strain there too."""
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device")
    law, random = load_law(name), np.random.default_rng(8)
    m = law.parameters(Material(name, 0.3, 0.47, asdict(type(law).example())))
    dF = random.normal(size=(200, 3, 3))
    for size in (1e-3, 0.15):
        H = size * random.uniform(-1, 1, (200, 3, 3))
        wanted = evaluate(law, m, H, dF, of="H")
        for real, allowed in ((wp.float64, 1e-10), (wp.float32, 2e-5)):
            found = evaluate(law, m, H, dF, real, "H", "cuda:0")
            for quantity in ("stress", "tangent"):
                a, b = getattr(found, quantity), getattr(wanted, quantity)
                assert (np.linalg.norm(a - b, axis=(1, 2)) < allowed * np.linalg.norm(b, axis=(1, 2)).max()).all()
