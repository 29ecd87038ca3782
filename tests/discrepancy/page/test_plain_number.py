"""Numbers in verdicts have no power of ten where people read them without."""

import pytest

from tacdata.discrepancy.plain_number import plain_number


@pytest.mark.parametrize(
    "value, digits, words",
    [
        (99.6, 2, "100"),
        (100.0, 2, "100"),
        (18_960.0, 2, "19000"),
        (-1234.5, 3, "-1230"),
        (0.0, 2, "0"),
        (7.0, 2, "7"),
        (0.00314, 2, "0.0031"),
        (999_999.0, 2, "1e+06"),
        (float("nan"), 2, "nan"),
    ],
)
def test_a_number_is_rounded_and_written_out(value, digits, words):
    assert plain_number(value, digits) == words
