"""Names hold at a level, beside a remainder of the size that is left."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tacdata.discrepancy.levels.margins import BesideRemainder, Level
from tacdata.discrepancy.levels.remainder import _size
from tacdata.discrepancy.search.findings import FoundEffect
from tacdata.discrepancy.verdict.decide import finest, stands_in
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


@pytest.mark.parametrize(
    ("margins", "level"),
    [
        ({"creep": 4.0, "backlash": 4.0}, Level.FORM),
        ({"creep": 1.0, "backlash": 4.0}, Level.FAMILY),
        ({"creep": 4.0, "backlash": 1.0}, None),
    ],
)
def test_a_level_holds_where_no_rival_of_it_is_near_beside_the_remainder(margins, level):
    assert finest(NOTHING, ONE, BesideRemainder(5.0, margins)) is level


def test_a_form_between_two_is_named_as_a_mechanism():
    between = replace(ONE, forms={"power_creep": 1.0})
    assert finest(NOTHING, between, BesideRemainder(5.0, {})) is Level.MECHANISM


def test_an_effect_that_the_remainder_could_be_is_not_named():
    assert finest(NOTHING, ONE, BesideRemainder(1.0, {"backlash": 9.0})) is None
    assert finest(NOTHING, replace(ONE, at_bound=("f",)), BesideRemainder(9.0, {})) is None
    assert finest(NOTHING, replace(ONE, necessity=3.0, corrected_p=0.02), BesideRemainder(9.0, {})) is None


@pytest.mark.parametrize(
    ("bought", "left", "t", "part"), [(100, 30, 5, True), (100, 10, 5, False), (100, 30, 1, False)]
)
def test_a_further_name_may_stand_in_for_what_is_left(bought, left, t, part):
    """What it explains beyond the others must be large beside what nothing explains."""
    found = cast(Any, SimpleNamespace(effects=(ONE, ONE), left=SimpleNamespace(t=t, gain=left)))
    assert stands_in(found, replace(ONE, bought=bought)) == part
    alone = cast(Any, SimpleNamespace(effects=(ONE,), left=SimpleNamespace(t=t, gain=left)))
    assert not stands_in(alone, replace(ONE, bought=bought))
