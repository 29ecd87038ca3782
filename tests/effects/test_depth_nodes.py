"""Interpolation between solved depths is an explanation only where a table's depths stand far apart."""

from types import SimpleNamespace

import pytest

from tacdata.effects import load


@pytest.mark.parametrize(("spacing", "told"), [(0.1, True), (0.5, False), (None, False)])
def test_a_table_solved_at_close_depths_is_not_blamed(spacing, told):
    response, course = SimpleNamespace(spacing=spacing, fitted=False), SimpleNamespace(span=1.2)
    reason = load("depth_nodes").unjudgeable(course, response)
    assert ("0.1 mm apart" in reason) if told else not reason
