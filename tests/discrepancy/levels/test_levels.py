"""Names hold at a level, beside a remainder of the size that is left."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tacdata.discrepancy.levels.constancy import spread
from tacdata.discrepancy.levels.margins import BesideRemainder, Level
from tacdata.discrepancy.levels.remainder import _size
from tacdata.discrepancy.levels.several_names import beside_open, stands_in
from tacdata.discrepancy.search.findings import FoundEffect
from tacdata.discrepancy.verdict.decide import beside_much, finest, leading, seems_early, stands
from tacdata.discrepancy.verdict.sealed import Gap
from tacdata.effects import Placed, load

MARGINS = {"creep": 9.0, "backlash": 9.0}
ONE = FoundEffect(
    Placed(load("relaxation"), {}), {}, (), (), MARGINS, 9.0, corrected_p=0.001, forms={"power_creep": 5.0}
)
NOTHING = cast(Any, None)


@pytest.mark.parametrize("tau", [0.3, 1.0, 3.0])
def test_the_size_of_a_remainder_is_found_by_its_likelihood(tau):
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(5000, 40))
    found = []
    for _ in range(20):
        residual = columns @ (tau * rng.normal(size=40)) + rng.normal(size=5000)
        found.append(_size(columns.T @ columns, columns.T @ residual, float(residual @ residual), 5000.0))
    assert np.median(found) == pytest.approx(tau, rel=0.15)


def test_noise_alone_leaves_no_remainder():
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(5000, 40))
    sizes = []
    for _ in range(20):
        noise = rng.normal(size=5000)
        sizes.append(_size(columns.T @ columns, columns.T @ noise, float(noise @ noise), 5000.0))
    assert np.median(sizes) < 0.01


@pytest.mark.parametrize(("rivals", "level"), [((), Level.FORM), (("creep",), Level.FAMILY), (("backlash",), None)])
def test_a_level_holds_where_no_rival_of_it_is_near(rivals, level):
    assert finest(replace(ONE, rivals=rivals)) is level


def test_a_form_between_two_is_named_as_a_mechanism():
    assert finest(replace(ONE, forms={"power_creep": 1.0})) is Level.MECHANISM


def test_an_effect_that_is_not_surely_there_is_not_named():
    assert finest(replace(ONE, at_bound=("f",))) is None
    assert finest(replace(ONE, at_bound=("tau",))) is Level.FAMILY, "a shape at its bound: the form is another one"
    assert finest(replace(ONE, necessity=3.0, corrected_p=0.02)) is None


@pytest.mark.parametrize(
    ("spread", "bought", "level"),
    [(0.05, 100, Level.MECHANISM), (0.15, 100, Level.FAMILY), (0.4, 100, None), (0.05, 20, None)],
)
def test_beside_much_without_a_name_an_effect_stands_by_its_size_in_all_conditions(spread, bought, level):
    beside = BesideRemainder(0.0, {}, {"rate": spread, "depth": 0.0})
    assert beside_much(leaving(30.0), replace(ONE, bought=bought), beside) is level


def test_one_that_looks_like_another_family_is_there_without_a_name():
    """One rate does not tell it from play: it stands, and is named at no level."""
    beside = BesideRemainder(0.0, {}, {"depth": 0.05})
    alike = replace(ONE, rivals=("backlash",), bought=100.0)
    assert stands(leaving(30.0), alike, beside) and beside_much(leaving(30.0), alike, beside) is None
    assert not stands(leaving(30.0), replace(alike, at_bound=("f",)), beside)


@pytest.mark.parametrize(("spread", "after", "there"), [(0.05, 1.5, True), (0.22, 1.5, False), (0.05, 8.0, False)])
def test_a_sealed_gap_that_surely_closes_says_that_an_effect_is_there(spread, after, there):
    """What is left of the open presses may be more: it is not in the sealed ones."""
    shown = Gap(np.full(5, 10.0), np.full(5, after), np.ones(5), tuple("abcde"))
    one = replace(ONE, bought=20.0)
    assert stands(leaving(30.0), one, BesideRemainder(0.0, {}, {"rate": spread}), shown) == there


def test_a_rival_that_needs_an_unphysical_size_leaves_the_family_beside_a_remainder():
    """What is left lends it what it explains. Without much left, it stays a rival."""
    beside = BesideRemainder(0.0, {}, {"rate": 0.05})
    alike = replace(ONE, rivals=("backlash",), unphysical=("backlash",), bought=100.0)
    assert beside_much(leaving(30.0), alike, beside) is Level.FAMILY and finest(alike) is None
    both = replace(alike, rivals=("backlash", "latency"))
    assert beside_much(leaving(30.0), both, beside) is None, "a delay does as well, of a size that may be"


def test_a_shape_at_its_bound_leaves_the_family():
    """A bound of an exponent says that the form is another one; a bound of an amplitude, that it is another thing."""
    beside, read = BesideRemainder(0.0, {}, {"rate": 0.05}), Placed(load("relaxation_read"), {})
    bent = replace(ONE, placed=read, bought=100.0, at_bound=("m",))
    assert beside_much(leaving(30.0), bent, beside) is Level.FAMILY
    assert beside_much(leaving(30.0), replace(bent, at_bound=("f",)), beside) is None


def test_readings_that_come_early_beside_a_memory_are_its_form():
    """Without a memory they say that two clocks are not one."""
    early, late = (replace(ONE, placed=Placed(load("latency"), {"L": np.array(lag)})) for lag in (-0.06, 0.06))
    assert seems_early(early, [ONE, early]) and not seems_early(late, [ONE, late])
    assert not seems_early(early, [early]) and not seems_early(ONE, [ONE, early])


def test_the_effect_that_explains_most_leads():
    calibrated = replace(ONE, corrected_p=None, bought=float("inf"))
    assert leading([replace(ONE, bought=10.0), replace(ONE, bought=20.0), calibrated]) == 1
    assert leading([calibrated]) is None


def leaving(gain, *names):
    """Findings that leave much, of a search that tried some effects."""
    given = SimpleNamespace(candidates=[SimpleNamespace(effect=load(name)) for name in names])
    return cast(Any, SimpleNamespace(left=SimpleNamespace(gain=gain), given=given))


def parts(sizes, episodes=30, noise=1.0):
    """Grams of a residual that holds one column in two parts, each episode in one of them."""
    rng, gram = np.random.default_rng(7), np.zeros((episodes, 3, 3))
    for e in range(episodes):
        columns = np.zeros((400, 3))
        columns[:, 1 + e % 2] = rng.normal(size=400)
        columns[:, 0] = columns[:, 1:] @ sizes + noise * rng.normal(size=400)
        gram[e] = columns.T @ columns
    return gram


def test_the_spread_of_a_size_is_what_its_parts_differ_by():
    assert spread(parts(np.array([0.3, -0.3])), 2) == pytest.approx(0.3, rel=0.1)


def test_a_part_that_holds_little_of_an_effect_counts_like_the_others():
    """What fits fast presses alone is found by the slow ones."""
    gram = parts(np.array([0.0, 0.5]))
    gram[:, 2] *= 0.2
    gram[:, :, 2] *= 0.2
    assert spread(gram, 2) == pytest.approx(2.5 / np.sqrt(2), rel=0.1)


def test_chance_is_no_spread():
    assert spread(parts(np.array([0.0, 0.0]), noise=5.0), 2) < 0.05


@pytest.mark.parametrize(
    ("bought", "left", "t", "part"), [(100, 30, 5, True), (100, 10, 5, False), (100, 30, 1, False)]
)
def test_a_further_name_may_stand_in_for_what_is_left(bought, left, t, part):
    """What it explains beyond the others must be large beside what nothing explains."""
    mine = replace(ONE, bought=bought)
    found = cast(Any, SimpleNamespace(effects=(mine, mine), left=SimpleNamespace(t=t, gain=left)))
    assert stands_in(found, mine, {}) == part
    alone = cast(Any, SimpleNamespace(effects=(ONE,), left=SimpleNamespace(t=t, gain=left)))
    assert not stands_in(alone, replace(ONE, bought=bought), {})


@pytest.mark.parametrize(
    ("bought", "left", "t", "part"),
    [(100, 150, 1.2, True), (100, 90, 1.2, False), (100, 150, 0.8, False), (3, 5, 1.2, False), (300, 900, 1.2, False)],
)
def test_where_more_is_left_than_a_further_name_explains_less_of_that_need_be_sure(bought, left, t, part):
    """A cable that moves along is left, and an air gap with a number for each channel takes up a part of it."""
    large, mine = replace(ONE, placed=Placed(load("latency"), {}), bought=200.0), replace(ONE, bought=bought)
    found = cast(Any, SimpleNamespace(effects=(large, mine), left=SimpleNamespace(t=t, gain=left)))
    assert stands_in(found, mine, {}) == part, "what explains most is no part of another"


@pytest.mark.parametrize(("bought", "part"), [(50, True), (200, False)])
def test_a_further_name_may_stand_in_for_the_form_of_another(bought, part):
    """A law of a material is off by a tenth and leaves a hundredth, though nothing stands out. A delay is exact."""
    large, small = replace(ONE, bought=10000.0), replace(ONE, bought=float(bought))
    found = cast(Any, SimpleNamespace(effects=(large, small), left=SimpleNamespace(t=0.0, gain=0.0)))
    assert stands_in(found, small, {}) == part and not stands_in(found, large, {})
    exact = replace(large, placed=Placed(load("latency"), {}))
    assert not stands_in(cast(Any, SimpleNamespace(effects=(exact, small), left=found.left)), small, {})
    gain = replace(ONE, bought=float("inf"), corrected_p=None)
    found = cast(Any, SimpleNamespace(effects=(gain, small), left=SimpleNamespace(t=0.0, gain=0.0)))
    assert not stands_in(found, small, {}), "what calibration shows has no such figure"


@pytest.mark.parametrize(("bought", "left", "named"), [(100, 0, True), (100, 50, False), (5, 0, False)])
def test_what_explains_most_is_named_beside_one_that_is_open(bought, left, named):
    """An effect that may be another one counts as left over: beside little of that, the large one is sure."""
    found = cast(Any, SimpleNamespace(left=SimpleNamespace(t=5.0, gain=left)))
    answer = [replace(ONE, bought=bought), replace(ONE, bought=3.0, rivals=("backlash",))]
    assert beside_open(found, answer, [Level.FORM, None]) == [Level.FORM if named else None, None]
