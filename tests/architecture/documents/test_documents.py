"""Documents are read as their standards say, and nothing in them is lost without a word."""

import pytest

from tacdata.documents import parsed
from tacdata.errors import FormatError


@pytest.mark.parametrize(
    ("text", "key", "lines"),
    [
        ("a: 1\nb: 2\na: 3\n", "'a'", (1, 3)),
        ("presses:\n- {x: 1}\nmotion:\n  hold: 1\n  hold: 2\n", "'hold'", (4, 5)),
        ('{"a": {"b": 1,\n "b": 2}}', "'b'", (1, 2)),
        ("1: a\n1: b\n", "1", (1, 2)),
    ],
)
def test_a_key_given_twice_is_refused_with_both_lines(text, key, lines):
    with pytest.raises(FormatError) as caught:
        parsed(text, "plan.yaml")
    assert f"plan.yaml: {key} is given twice, in line {lines[0]} and in line {lines[1]}" in caught.value.given


def test_numbers_are_read_as_yaml_1_2_has_them():
    found = parsed("a: 1e-7\nb: 1.0e12\nc: -2E3\nd: '1e5'\ne: 12e\nf: 1.5\ng: v1e5\n", "file")
    assert found == {"a": 1e-7, "b": 1e12, "c": -2000.0, "d": "1e5", "e": "12e", "f": 1.5, "g": "v1e5"}


def test_what_is_merged_in_may_be_overruled():
    assert parsed("base: &base {a: 1, b: 2}\nmore:\n  <<: *base\n  b: 3\n", "file")["more"] == {"a": 1, "b": 3}
