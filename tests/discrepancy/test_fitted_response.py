"""A response fitted to recordings: what it says in the air is an offset, and no history."""

from dataclasses import replace

import numpy as np
from pressing import course

from tacdata.discrepancy.fitted_response import FittedResponse


def test_a_places_own_level_is_no_load():
    """Readings that are higher at one place in the air leave the load there zero, and pressed as it was."""
    plain = course(noise=0.1)
    level = np.where(plain.row_site == plain.row_site.max(), 40.0, 0.0)[:, None]
    raised = replace(plain, readings=plain.readings + level)
    air = plain.tip[:, 2] <= 0
    loads = [FittedResponse(c).load(c.tip, c.tool) for c in (plain, raised)]
    assert np.abs(loads[1][air]).max() < 0.01 * np.abs(loads[1]).max()
    # Without that the level itself would be the difference: 40.
    assert np.abs(loads[1] - loads[0]).max() < 2.0


def test_the_same_depths_asked_again_are_answered_the_same():
    made = course()
    response = FittedResponse(made)
    deeper = made.tip + np.array([0.0, 0.0, 0.05])
    first = response.load(made.tip, made.tool)
    assert not np.allclose(response.load(deeper, made.tool), first)
    np.testing.assert_array_equal(response.load(made.tip, made.tool), first)
