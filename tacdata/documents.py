"""Reads, checks and writes YAML and JSON documents by the schemas in `schemas/`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator

import schemas
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.replacement import replacement


def read(path: Path, schema: str) -> dict[str, Any]:
    """Return the document at ``path``, checked against a schema.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is not YAML/JSON, has another major version, or breaks the schema.

    Example:
        >>> from pathlib import Path
        >>> from tacdata import documents
        >>> case = documents.read(Path("examples/cases/sphere_on_slab.yaml"), "case")
        >>> case["indenter"]
        {'shape': 'sphere', 'radius': 4.0}
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", f"a {schema} file (YAML or JSON)", "check the path")
    try:
        document = parsed(path.read_text(encoding="utf-8"), str(path))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise FormatError(f"{path} is not readable as YAML: {error}", f"a {schema} file", "fix the syntax") from None
    check(document, schema, str(path))
    return document


def parsed(text: str, origin: str) -> Any:
    """Return the content of a YAML or JSON text; ``origin`` names it in errors.

    Raises:
        FormatError: If a key is given twice, with both lines.
        yaml.YAMLError: If it is neither.
    """
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except ValueError:
        loader = _Loader(text)
        loader.origin = origin
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a JSON text; duplicate keys are left to `_Loader`, which knows the lines."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key twice")
    return found


class _Loader(yaml.SafeLoader):
    """YAML 1.2's numbers (``1e-7``, ``1.0e12``), and no duplicate keys."""

    origin = ""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return the mapping.

        Raises:
            FormatError: If two of its keys are equal.
        """
        lines: dict[Any, int] = {}
        for key, _ in node.value:
            if key.tag == "tag:yaml.org,2002:merge":
                continue  # merged keys may be overridden: that is their purpose
            name, line = self.construct_object(key, deep=True), key.start_mark.line + 1
            if name in lines:
                raise FormatError(
                    f"{self.origin}: {name!r} is given twice, in line {lines[name]} and in line {line}",
                    "each key once",
                    "delete or rename one of the two",
                )
            lines[name] = line
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+0123456789."),
)


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
    """Write a file so that a crash leaves either the old one or the new one.

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
