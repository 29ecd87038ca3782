"""Documents as people save them: any byte order mark, names composed or not, numbers as YAML 1.2 has them."""

import json

import pytest

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.plans import read_plan

PLAN = """version: "1.0"
name: p
indenters:
  ball: {shape: sphere, radius: 2.0}
motion: {clearance: 2.0, travel_speed: 10.0, approach_speed: 2.0, press_speed: 1.0, hold: 0.5, rest: 0.5}
presses:
  - {indenter: ball, x: 0.0, y: 0.0, depth: 1.0}
"""


def refusal(path, data):
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(FormatError) as caught:
        documents.read(path, "plan")
    return caught.value.given


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
@pytest.mark.parametrize("form", ["yaml", "json"])
def test_a_byte_order_mark_says_the_encoding(tmp_path, encoding, form):
    text = PLAN if form == "yaml" else json.dumps(documents.parsed(PLAN, "plan"), indent="\t")
    path = tmp_path / f"plan.{form}"
    path.write_bytes(text.encode(encoding))
    assert documents.read(path, "plan") == documents.parsed(PLAN, "plan")


@pytest.mark.parametrize("second", ['"name": "q"', '"n\\u0061me": "q"'])
def test_a_key_twice_in_json_is_refused_with_both_lines(tmp_path, second):
    text = json.dumps(documents.parsed(PLAN, "plan"), indent="\t").replace('"name": "p"', f'"name": "p",\n\t{second}')
    assert "'name' is given twice, in line 3 and in line 4" in refusal(tmp_path / "plan.json", text)


def test_an_umlaut_of_two_characters_is_the_same_name(tmp_path):
    composed, decomposed = "K\u00fcgel", "Ku\u0308gel"
    path = tmp_path / "plan.yaml"
    path.write_text(PLAN.replace("ball: {", f"{composed}: {{").replace("indenter: ball", f"indenter: {decomposed}"))
    assert read_plan(path).presses[0].indenter_name == composed
    twice = PLAN.replace("  ball:", f"  {composed}: {{shape: sphere, radius: 1}}\n  {decomposed}: {{}}\n  ball:")
    assert "is given twice, in line 4 and in line 5" in refusal(path, twice)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10),
        ("1:30", "1:30"),
        ("1_0", "1_0"),
        ("0x10", 16),
        ("0o10", 8),
        ("2e-1", 0.2),
        ("-.5", -0.5),
        ("1.", 1.0),
        ("+3", 3),
        ("0b11", "0b11"),
    ],
)
def test_numbers_are_those_of_yaml_1_2(text, value):
    found = documents.parsed(f"a: {text}", "here")["a"]
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("number", [".nan", "-.inf", "1e999"])
def test_a_number_that_is_not_finite_is_named(tmp_path, number):
    assert "presses/0/depth:" in refusal(tmp_path / "plan.yaml", PLAN.replace("depth: 1.0", f"depth: {number}"))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (" \n", "is empty"),
        ("[" * 100_000, "nested too deeply"),
        ("a: " + "[" * 3000, "nested too deeply"),
        (
            PLAN.replace("name: p", "name: M\u00fcller").encode("latin-1"),
            "no text in UTF-8: invalid start byte in line 2",
        ),
        ("? [1, 2]\n: 3\n", "a list or mapping as a key"),
        (PLAN.replace("depth: 1.0", "depth: " + "9" * 5000), "digits"),
        (PLAN + "---\n" + PLAN, "single document"),
    ],
)
def test_what_cannot_be_read_ends_in_words(tmp_path, data, words):
    assert words in refusal(tmp_path / "plan.yaml", data)


def test_json_is_told_of_as_json(tmp_path):
    text = json.dumps(documents.parsed(PLAN, "plan"), indent="\t")
    assert "not readable as JSON: Unterminated string" in refusal(tmp_path / "plan.json", text[:-20])
