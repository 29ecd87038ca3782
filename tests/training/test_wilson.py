"""Wilson's interval solves (p - q)^2 = z^2 q (1 - q) / n for q; here its roots are found independently."""

import numpy as np
import pytest

from tacdata.errors import UsageError
from training.scoring.wilson import interval

PAPER = [(15, 40), (27, 40), (35, 40), (4, 20), (9, 20), (17, 20)]


@pytest.mark.parametrize(("successes", "trials"), PAPER)
def test_the_bounds_are_the_roots_of_the_quadratic(successes, trials):
    z2, p = 1.959963984540054**2, successes / trials
    roots = np.sort(np.roots([1 + z2 / trials, -(2 * p + z2 / trials), p * p]))
    assert interval(successes, trials) == pytest.approx(tuple(roots), abs=1e-12)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Worked out with a pocket calculator from the quadratic, z^2 = 3.841459, to four digits.
    [
        (15, 40, 0.2422, 0.5297),
        (27, 40, 0.5202, 0.7992),
        (35, 40, 0.7389, 0.9454),
        (4, 20, 0.0807, 0.4160),
        (9, 20, 0.2582, 0.6579),
        (17, 20, 0.6396, 0.9476),
    ],
)
def test_the_proportions_of_the_paper(successes, trials, low, high):
    assert interval(successes, trials) == pytest.approx((low, high), abs=6e-5)


def test_the_bounds_stay_within_zero_and_one():
    assert interval(0, 10)[0] == 0.0
    assert interval(10, 10)[1] == 1.0
    assert interval(0, 10)[1] == pytest.approx(3.841459 / (10 + 3.841459), abs=1e-6)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (-1, 3), (4, 3)])
def test_counts_that_make_no_proportion_are_refused(successes, trials):
    with pytest.raises(UsageError, match="successes"):
        interval(successes, trials)
