"""The optional sections of a sensor file: a law's parameters, transduction."""

import copy

import pytest

from tacdata.errors import FormatError
from tacdata.sensor import Sensor, default_sensor


def document(**changes):
    """The default sensor's file with nested changes: ``material__prony=...``."""
    result = copy.deepcopy(default_sensor().document)
    for path, value in changes.items():
        *parents, last = path.split("__")
        place = result
        for parent in parents:
            place = place[parent]
        place[last] = value
    return result


def read(**changes):
    return Sensor.from_document(document(**changes), "mine.yaml")


def test_an_old_file_is_read_and_keeps_its_hash():
    """Files of format 1.0 know none of the sections; the hash is in every label that was ever made from them."""
    old = document(version="1.0")
    del old["transduction"]
    sensor = Sensor.from_document(old, "old.yaml")
    assert sensor.transduction is None and sensor.material.parameters == {}
    assert sensor.content_hash == "6e293764d72208d5fcdb660c7250bf8f5979af41e78dad9d2c2b8eb7021f9395"
    assert sensor.content_hash == default_sensor().content_hash


def test_what_is_given_is_kept_and_changes_the_hash():
    sensor = read(material__law="ogden", material__parameters={"exponent": [2, -2], "share": [0.8, 0.2]})
    assert sensor.content_hash != default_sensor().content_hash
    assert Sensor.from_document(sensor.document, "again") == sensor


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material__prony": [{"share": 0.1, "time": 1.0}]}, "'prony' was unexpected"),  # no model reads it
        ({"material__parameters": {"c01_share": "a bit"}}, "a number or a list"),
        ({"transduction__gain": [1.0, 2.0]}, "gain has 2 numbers for 24 taxels"),
        ({"transduction__parameters": {"modulus": [0.1] * 23}}, "modulus has 23 numbers for 24 taxels"),
        ({"transduction__full_scale": 0}, "positive"),
        ({"transduction": {"gain": 1.0}}, "'principle' is a required property"),
        ({"transduction__offset": "some"}, "a list with one for each taxel"),
    ],
)
def test_contradictions_are_refused_in_words(changes, words):
    with pytest.raises(FormatError, match=words):
        read(**changes)
