"""What every principle must satisfy, and each of them against its closed form."""

import numpy as np
import pytest

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.transduction import Loads
from tacdata.transduction.principles.gap_closing import GapClosing
from tacdata.transduction.principles.linear import Linear
from tacdata.transduction.principles.principle import BASE, PERMITTIVITY, ROOM, Principle
from tacdata.transduction.principles.soft_dielectric import SoftDielectric

NAMES = registry.names(ROOM, BASE)
SPREAD = {"soft_dielectric": {"spread": 1.5}}
"""Numbers beside the defaults that make area count."""


def make(name):
    return registry.load(ROOM, BASE, name, Principle).from_numbers(SPREAD.get(name, {}))


def some_loads(count=50, taxels=3):
    random = np.random.default_rng(2)
    force, closure, area = (
        random.uniform(low, high, (count, taxels)) for low, high in ((0, 0.12), (-0.1, 0.6), (0.1, 1.2))
    )
    return Loads(force, closure, area)


def column(*values):
    return np.array(values, dtype=float)[:, None]


@pytest.mark.parametrize("name", NAMES)
class TestPrinciple:
    def test_derivatives_are_those_of_the_capacitance(self, name):
        principle, loads, h = make(name), some_loads(), 1e-7
        assert not principle.saturated(loads).any()
        found = principle.derivatives(loads)
        for field in ("force", "closure", "area"):
            up, down = (
                principle.capacitance(Loads(**{**vars(loads), field: getattr(loads, field) + s * h})) for s in (1, -1)
            )
            slope = getattr(found, field)
            assert slope.shape == loads.force.shape
            assert np.allclose((up - down) / (2 * h), slope, rtol=1e-6, atol=1e-8)

    def test_more_load_never_lowers_the_reading(self, name):
        slopes = make(name).derivatives(some_loads())
        assert slopes.force.min() >= 0 and slopes.closure.min() >= 0
        assert (slopes.force + slopes.closure).min() > 0

    def test_the_inverse_finds_what_was_felt(self, name):
        principle, loads = make(name), some_loads()
        found = principle.inverse(principle.capacitance(loads), loads.area)
        told = [f for f in ("force", "closure") if np.isfinite(getattr(found, f)).all()]
        assert told
        for field in told:
            assert np.allclose(getattr(found, field), getattr(loads, field), atol=1e-12)

    def test_numbers_may_differ_between_taxels(self, name):
        one, loads = make(name), some_loads()
        field, value = next(iter(vars(one).items()))
        several = type(one).from_numbers({**SPREAD.get(name, {}), field: [value, 1.3 * value, value]})
        a, b = one.capacitance(loads), several.capacitance(loads)
        assert np.array_equal(a[:, [0, 2]], b[:, [0, 2]])
        assert (a[:, 1] != b[:, 1]).all()

    @pytest.mark.parametrize("value", ["much", True, float("nan"), [[1.0]]], ids=repr)
    def test_what_is_no_number_is_refused(self, name, value):
        field = next(iter(vars(make(name))))
        with pytest.raises(FormatError, match=rf"{name}: {field}(.|\n)*finite"):
            type(make(name)).from_numbers({field: value})

    def test_an_unknown_number_is_refused_with_the_known_ones(self, name):
        with pytest.raises(FormatError, match=rf"colour(.|\n)*{next(iter(vars(make(name))))}"):
            type(make(name)).from_numbers({"colour": 1.0})


def test_plates_whose_gap_closes():
    plates = GapClosing(
        electrode_area=2.0, gap=0.5, permittivity=3.0, parasitic=0.7, closure_share=0.8, insulation=0.05
    )
    none = column(0.0, 0.0, 0.0)
    found = plates.capacitance(Loads(none + 5.0, column(0.0, 0.25, -0.1), none))
    wanted = 8.8541878188e-3 * 3.0 * 2.0 / (0.5 - 0.8 * column(0.0, 0.25, -0.1)) + 0.7
    assert np.allclose(found, wanted, rtol=1e-14)


def test_plates_that_meet_are_held_by_their_insulation():
    plates = GapClosing(electrode_area=2.0, gap=0.5, permittivity=3.0, parasitic=0.7, insulation=0.05)
    closure = column(0.44, 0.46, 0.6, 5.0)
    loads = Loads(0 * closure, closure, 0 * closure)
    assert plates.saturated(loads)[:, 0].tolist() == [False, True, True, True]
    assert np.allclose(plates.capacitance(loads)[1:], 8.8541878188e-3 * 6.0 / 0.05 + 0.7)
    assert np.array_equal(plates.derivatives(loads).closure[1:], np.zeros((3, 1)))
    found = plates.inverse(plates.capacitance(loads), loads.area).closure
    assert found[0, 0] == pytest.approx(0.44)
    assert np.isnan(found[1:]).all()


def test_gap_closing_does_not_feel_force_and_soft_dielectric_does_not_feel_closure():
    """In displacement control this decides what a reading can show: stiffness and relaxation, or neither."""
    a = some_loads()
    stiffer = Loads(2 * a.force, a.closure, a.area)
    displaced = Loads(a.force, a.closure + 0.05, a.area)
    gap, soft = GapClosing(), SoftDielectric()
    assert np.array_equal(gap.capacitance(stiffer), gap.capacitance(a))
    assert (gap.capacitance(displaced) > gap.capacitance(a)).all()
    assert np.array_equal(soft.capacitance(displaced), soft.capacitance(a))
    assert (soft.capacitance(stiffer) > soft.capacitance(a)).all()


def test_a_wide_spread_loads_the_whole_electrode():
    soft = SoftDielectric(electrode_area=3.0, thickness=0.2, permittivity=3.0, modulus=0.2, parasitic=1.0)
    force = column(0.0, 0.06, 0.3)
    loads = Loads(force, 0 * force, column(0.0, 0.1, 0.5))
    wanted = 8.8541878188e-3 * 3.0 * 3.0 / (0.2 * (1 - force / (3.0 * 0.2))) + 1.0
    assert np.allclose(soft.capacitance(loads), wanted, rtol=1e-13)
    assert np.array_equal(soft.derivatives(loads).area, np.zeros((3, 1)))


def test_without_spread_the_contact_alone_is_squeezed():
    """Two capacitors in parallel: the contact's part with a thinner layer, the rest as it was."""
    soft = SoftDielectric(electrode_area=3.0, thickness=0.2, permittivity=3.0, modulus=0.5, spread=0.0, parasitic=0.0)
    force, area = 0.1, 0.8
    squeezed = 0.2 * (1 - force / area / 0.5)
    wanted = PERMITTIVITY * 3.0 * ((3.0 - area) / 0.2 + area / squeezed)
    found = soft.capacitance(Loads(column(force), column(0.0), column(area)))
    assert found[0, 0] == pytest.approx(wanted, rel=1e-13)
    # The same force on less area squeezes harder.
    assert soft.derivatives(Loads(column(force), column(0.0), column(area))).area[0, 0] < 0


def test_a_crushed_layer_yields_no_more():
    soft = SoftDielectric(electrode_area=3.0, modulus=0.2, largest_strain=0.9)
    force = column(0.5, 0.55, 0.6, 50.0)
    loads = Loads(force, 0 * force, 0 * force)
    assert soft.saturated(loads)[:, 0].tolist() == [False, True, True, True]
    found = soft.capacitance(loads)
    assert np.isfinite(found).all() and (found[1:] == found[1]).all() and found[1] > found[0]
    assert np.array_equal(soft.derivatives(loads).force[1:], np.zeros((3, 1)))
    assert np.isnan(soft.inverse(found, loads.area).force[1:]).all()


def test_modulus_and_rest_gap_are_the_same_to_a_layer_under_pressure():
    """Only p/E_d enters the relative change: what no indentation can tell apart the model must not either."""
    force = column(0.01, 0.1, 0.3)
    loads = Loads(force, 0 * force, 0 * force)
    a, b = SoftDielectric(modulus=0.3, parasitic=0.0), SoftDielectric(modulus=0.3, thickness=0.4, parasitic=0.0)
    none = Loads(0 * force, 0 * force, 0 * force)
    assert np.allclose(a.capacitance(loads) / a.capacitance(none), b.capacitance(loads) / b.capacitance(none))


def test_the_baseline_tells_force_or_closure_but_not_both():
    c = column(1.3)
    assert Linear(per_newton=2.0).inverse(c, c).force[0, 0] == pytest.approx(0.15)
    assert Linear(per_newton=0.0, per_millimetre=2.0).inverse(c, c).closure[0, 0] == pytest.approx(0.15)
    both = Linear(per_newton=1.0, per_millimetre=2.0).inverse(c, c)
    assert np.isnan(both.force).all() and np.isnan(both.closure).all()


@pytest.mark.parametrize(
    ("kind", "numbers", "words"),
    [
        (GapClosing, {"gap": 0.0}, "gap = 0"),
        (GapClosing, {"gap": 0.5, "insulation": 0.6}, "insulation 0.6 mm"),
        (GapClosing, {"parasitic": -1.0}, "parasitic = -1"),
        (GapClosing, {"electrode_area": [1.0, -2.0, 1.0]}, "electrode_area = -2"),
        (SoftDielectric, {"modulus": -0.2}, "modulus = -0.2"),
        (SoftDielectric, {"largest_strain": 1.0}, "below 1"),
        (SoftDielectric, {"spread": -1}, "spread below 0"),
    ],
)
def test_numbers_that_make_no_capacitor_are_refused(kind, numbers, words):
    with pytest.raises(FormatError, match=words):
        kind.from_numbers(numbers)
