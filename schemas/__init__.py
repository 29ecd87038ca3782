"""The shape of everything that crosses a file boundary, as data: JSON Schemas and protobuf messages."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files


def names() -> list[str]:
    """Return the names of the JSON Schemas, sorted."""
    ending = ".schema.json"
    return sorted(p.name.removesuffix(ending) for p in files(__name__).iterdir() if p.name.endswith(ending))


@cache
def load(name: str) -> dict:
    """Return the JSON Schema called ``name`` (its ``version`` key is the format's version)."""
    return json.loads((files(__name__) / f"{name}.schema.json").read_text())


def version(name: str) -> str:
    """Return the format version ("major.minor") that this code writes."""
    return load(name)["version"]
