"""Every format is data: a valid schema with a version, and a line in the schemas' README."""

import re
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from tacdata import schemas

FOLDER = Path(schemas.__file__).parent
README = (FOLDER / "README.md").read_text()
MESSAGES = sorted(p.name for p in FOLDER.rglob("*.proto"))


def objects(definition, path=""):
    """Yield (path, schema) of every object with named properties."""
    if isinstance(definition, dict):
        if "properties" in definition and definition.get("type") == "object":
            yield path, definition
        for key, value in definition.items():
            yield from objects(value, f"{path}/{key}")
    elif isinstance(definition, list):
        for index, value in enumerate(definition):
            yield from objects(value, f"{path}/{index}")


@pytest.mark.parametrize("name", schemas.names())
def test_a_schema_is_valid_versioned_and_documented(name):
    definition = schemas.load(name)
    assert definition["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    Draft202012Validator.check_schema(definition)
    assert re.fullmatch(r"[0-9]+\.[0-9]+", schemas.version(name))
    assert definition["title"] == name
    assert definition["description"]
    assert f"`{name}.schema.json`" in README


@pytest.mark.parametrize("name", schemas.names())
def test_a_document_names_its_own_version(name):
    definition = schemas.load(name)
    assert "version" in definition["properties"]
    assert "version" in definition["required"]


@pytest.mark.parametrize("name", schemas.names())
def test_numbers_with_a_dimension_name_their_unit(name):
    """A number field has a unit key or a description that says what it counts."""
    silent = [
        f"{path}/{field}"
        for path, schema in objects(schemas.load(name))
        for field, value in schema["properties"].items()
        if isinstance(value, dict)
        and value.get("type") == "number"
        and not (value.get("unit") or value.get("description"))
    ]
    assert not silent


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_file_is_documented(name):
    assert f"`{name}`" in README


def test_the_readme_names_nothing_that_is_missing():
    named = set(re.findall(r"`([a-z_]+\.(?:schema\.json|proto))`", README))
    assert named == {f"{name}.schema.json" for name in schemas.names()} | set(MESSAGES)
