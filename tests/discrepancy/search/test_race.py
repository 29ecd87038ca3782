"""What goes first in the race."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tacdata.discrepancy.search.race import physical_first


def model(half_bic, bound=False):
    bounds = ("f",) if bound else ()
    return cast(Any, SimpleNamespace(half_bic=half_bic, placed=(None,), bounds=lambda k: bounds))


@pytest.mark.parametrize(("explains", "first"), [(60, True), (40, False)])
def test_a_size_within_its_bounds_goes_before_one_at_them(explains, first):
    """It has to explain half as much as the best."""
    current = cast(Any, SimpleNamespace(half_bic=0.0, placed=()))
    unphysical, physical = model(-100.0, bound=True), model(-float(explains))
    assert (physical_first([unphysical, physical], current)[0] is physical) == first
    assert physical_first([physical, model(-99.0)], current)[0].half_bic == -99.0


def test_two_models_of_the_same_effects_are_ordered():
    """A model holds arrays, which have no one truth: models are told apart by what they are, not by their numbers."""
    current = cast(Any, SimpleNamespace(half_bic=0.0, placed=()))
    same = [
        cast(Any, SimpleNamespace(left=np.zeros(2), half_bic=-100.0, placed=(None,), bounds=lambda k, b=b: b))
        for b in (("f",), ())
    ]
    assert [m.bounds(0) for m in physical_first(same, current)] == [(), ("f",)]
