"""What goes first in the race."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from tacdata.discrepancy.search.race import physical_first


def model(half_bic, bound=False):
    errors = ({}, ("f",) if bound else ())
    return cast(Any, SimpleNamespace(half_bic=half_bic, placed=(None,), errors=lambda k: errors))


@pytest.mark.parametrize(("explains", "first"), [(60, True), (40, False)])
def test_a_size_within_its_bounds_goes_before_one_at_them(explains, first):
    """It has to explain half as much as the best."""
    current = cast(Any, SimpleNamespace(half_bic=0.0, placed=()))
    unphysical, physical = model(-100.0, bound=True), model(-float(explains))
    assert (physical_first([unphysical, physical], current)[0] is physical) == first
    assert physical_first([physical, model(-99.0)], current)[0].half_bic == -99.0
