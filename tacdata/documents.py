"""Read, check and write the YAML and JSON documents whose shape `schemas/` fixes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator

import schemas
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.replacement import replacement


def read(path: Path, schema: str) -> dict[str, Any]:
    """Return the document at ``path`` after checking it against a schema.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is not YAML/JSON, has another major version, or breaks the schema.
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", f"a {schema} file (YAML or JSON)", "check the path")
    try:
        document = _parsed(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise FormatError(f"{path} is not readable as YAML: {error}", f"a {schema} file", "fix the syntax") from None
    check(document, schema, str(path))
    return document


def _parsed(text: str) -> Any:
    """Return JSON as JSON: YAML 1.1 takes its ``1e-07`` for a text."""
    try:
        return json.loads(text)
    except ValueError:
        return yaml.safe_load(text)


def check(document: Any, schema: str, origin: str) -> None:
    """Check a document against ``schemas/<schema>.schema.json``; ``origin`` names it in the error.

    Raises:
        FormatError: Naming the first offending field, its value and what is allowed.
    """
    definition = schemas.load(schema)
    if isinstance(document, dict) and "version" in document:
        major = str(document["version"]).split(".")[0]
        if major != definition["version"].split(".")[0]:
            raise FormatError(
                f"{origin}: {schema} format version {document['version']}",
                f"version {definition['version']}",
                "use the tacdata release that wrote it, or convert the file",
            )
    errors = sorted(Draft202012Validator(definition).iter_errors(document), key=lambda e: list(e.absolute_path))
    if errors:
        first = errors[0]
        field = "/".join(str(part) for part in first.absolute_path) or "the document"
        unit = first.schema.get("unit", "") if isinstance(first.schema, dict) else ""
        hint = first.schema.get("description", "") if isinstance(first.schema, dict) else ""
        raise FormatError(
            f"{origin}: {field}: {first.message}" + (f" [{unit}]" if unit else ""),
            hint or f"what schemas/{schema}.schema.json says of {field}",
            f"change {field} and run again",
        )


def write_text(path: Path, text: str) -> None:
    """Write a file so that a crash leaves either the old one or the new one, never a half.

    Raises:
        DeviceError: If the disk refuses it.
    """
    try:
        with replacement(path) as stream:
            stream.write(text.encode())
    except OSError as error:
        raise DeviceError(
            f"writing {path} failed: {error}", "a folder that may be written, on a disk with room",
            "make room or choose another folder",
        ) from error  # fmt: skip


def write(path: Path, document: dict[str, Any], schema: str) -> None:
    """Check a document and write it, as YAML or JSON by the file's ending."""
    check(document, schema, str(path))
    as_yaml = path.suffix in (".yaml", ".yml")
    text = yaml.safe_dump(document, sort_keys=False) if as_yaml else json.dumps(document, indent=1)
    write_text(path, text + ("" if text.endswith("\n") else "\n"))
