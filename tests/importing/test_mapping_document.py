"""A mapping read from its document writes the same document again."""

from pathlib import Path

import pytest
import yaml

from tacdata import documents
from tacdata.importing.mapping import Mapping
from tacdata.importing.mapping_document import document_of

ROOT = Path(__file__).resolve().parents[2]
TIME = {"column": "t", "unit": "s"}
WHOLE = {
    "version": "1.6",
    "name": "everything",
    "source": "a bench",
    "files": {
        "board": {
            "path": ["run{n}_a.csv", "run{n}_b.csv"],
            "encoding": ["utf-8", "shift_jis"],
            "table": ["Ramp", "Hold"],
            "join": "continued",
            "derived": {"signed": "current * sign(direction)"},
            "missing": ["OVERLOAD", -999],
            "time": {**TIME, "offset": 0.0},
        },
        "stage": {"path": "run{n}_stage.csv", "header": False, "skip": 2, "time": {"rate": 50.0, "column": "frame"}},
    },
    "sensor": {"name": "six", "columns": 3, "rows": 2, "pitch_x": 4.0},
    "taxels": {"file": "board", "columns": "cap*", "unit": "pF", "missing": [0], "time": TIME},
    "position": {"file": "stage", "x": 1.5, "z": {"expression": "`set point` - error", "unit": "mm", "scale": -1.0}},
    "contact": {"x": 0.0, "z": {"file": "stage", "column": "touch"}, "known_from": "a feeler"},
    "measured": {"force": {"file": "board", "columns": ["Fz"], "unit": "N", "trusted": True}},
    "trials": {"column": "run"},
    "press": {"specimen": {"part": "n"}, "x": {"part": "n", "pattern": "x([0-9]+)"}, "depth": 0},
    "indenter": {"shape": "sphere", "radius": 3.0},
}
LISTED = {
    "version": "1.6",
    "name": "listed",
    "files": {"run": {"path": "run.csv", "time": {"rate": 20.0}}},
    "sensor": "sensor.yaml",
    "taxels": {"file": "run", "long": {"channel": "ch", "value": "reading"}},
    "schedule": {"file": "run", "presses": [{"start": 1.0, "depth": 2.0, "speed": 1.0}], "start": {"column": "begin"}},
}


def examples():
    found = [yaml.safe_load(path.read_text()) for path in sorted((ROOT / "examples").rglob("*.yaml"))]
    return [document for document in found if {"files", "taxels"} <= set(document)]


@pytest.mark.parametrize("document", [WHOLE, LISTED, *examples()], ids=lambda document: document["name"])
def test_a_mapping_writes_the_document_that_it_was_read_from(document):
    documents.check(document, "import_mapping", "test")
    again = document_of(Mapping.from_document(document, Path()))
    assert {**again, "version": document["version"]} == document


def test_an_expression_is_a_derived_column_of_its_file_and_no_entry_of_the_document():
    mapping = Mapping.from_document(WHOLE, Path())
    assert mapping.files["stage"].derived == {"position z": "`set point` - error"}
    assert "derived" not in document_of(mapping)["files"]["stage"]
