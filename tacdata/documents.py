"""Reads, checks and writes YAML and JSON documents by `schemas/`."""

from __future__ import annotations

import codecs
import json
import math
import re
import unicodedata
from collections.abc import Hashable
from contextlib import suppress
from itertools import accumulate
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator

from tacdata import schemas
from tacdata.errors import WRITABLE, DeviceError, FormatError, UsageError, refused_by_system
from tacdata.paths import StrPath
from tacdata.replacement import replacement

BYTE_ORDER_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""First bytes of a text and its encoding; the longer ones first."""
WRITTEN_BY_PEOPLE = frozenset(
    "calibration_board case demo_rig fingers frame_format gains import_mapping model_spec mounting plan "
    "plan_recipe replay_object rig robot sensor simulation_plan".split()
)
"""Documents in which a number that is not finite is a mistake; ours may state one."""


def read(path: StrPath, schema: str) -> dict[str, Any]:
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
    path = Path(path)
    document = content_of(path, schema)
    if schema in WRITTEN_BY_PEOPLE and (place := _not_finite(document)):
        raise FormatError(f"{path}: {place}", "finite numbers", f"correct {place.split(':')[0]}, or leave it out")
    check(document, schema, str(path))
    return document


def content_of(path: StrPath, schema: str) -> Any:
    """Return the contents of a YAML or JSON file, unchecked; ``schema`` names its kind in errors.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is neither, or gives a key twice.
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"no file {path}", f"a {schema} file (YAML or JSON)", "check the path")
    text = _decoded(path, schema)
    if not text.strip():
        raise FormatError(f"{path} is empty", f"a {schema} file (YAML or JSON)", "copy it again, or write it")
    try:
        return parsed(text, str(path))
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        words = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        form = "JSON" if path.suffix == ".json" else "YAML"
        if form == "JSON" and (fault := _json_fault(text)):
            words = fault
        raise FormatError(f"{path} is not readable as {form}: {words}", f"a {schema} file", "fix the syntax") from None


def _decoded(path: Path, schema: str) -> str:
    """Return a file's text by its byte order mark, which YAML allows in UTF-16 and UTF-32, else as UTF-8."""
    raw = path.read_bytes()
    encoding = next((name for mark, name in BYTE_ORDER_MARKS.items() if raw.startswith(mark)), "utf-8-sig")
    try:
        return raw.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise FormatError(
            f"{path} is no text in {encoding.removesuffix('-sig').upper()}: {error.reason} in line {line}",
            f"a {schema} file in UTF-8",
            "save it as UTF-8",
        ) from None


def _json_fault(text: str) -> str:
    """Return the fault of a JSON text, with its line; "" if nothing is."""
    try:
        json.loads(text)
    except (ValueError, RecursionError) as error:
        return str(error)
    return ""


def _not_finite(content: Any, place: str = "") -> str:
    """Return where a number is not finite, and which; "" if all are."""
    # Any other value has nothing inside.
    inner = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in inner:
        location = f"{place}/{key}" if place else str(key)
        if isinstance(value, float) and not math.isfinite(value):
            return f"{location}: {value}"
        if deeper := _not_finite(value, location):
            return deeper
    return ""


def parsed(text: str, origin: str) -> Any:
    """Return the content of a YAML or JSON text; ``origin`` names it in errors.

    Names are composed (NFC), so that an umlaut of one character and one of two are the same key.

    Raises:
        FormatError: If a key is given twice, with both lines.
        yaml.YAMLError: If it is neither.
        RecursionError: If it is nested too deeply.
    """
    # Only a combining mark, written or escaped, can make one name look like another.
    plain = text.isascii() and r"\u03" not in text
    with suppress(ValueError):
        content = json.loads(text, object_pairs_hook=_unique)
        return content if plain else _referring(content)
    # In JSON tabs are white space between the values, which YAML does not allow.
    content = _content(text.expandtabs(4) if text.lstrip().startswith(("{", "[")) else text, origin)
    return content if plain else _referring(content)


def _content(text: str, origin: str) -> Any:
    """Return the contents of a YAML text: by libyaml, ten times as fast, unless it fails or could run out of stack."""
    if _QuickLoader is not None and _nested(text) < DEEP:
        with suppress(yaml.YAMLError):  # the loader in Python reports it
            return _loaded(_QuickLoader(text), origin)
    return _loaded(_Loader(text), origin)


def _loaded(loader: Any, origin: str) -> Any:
    loader.origin = origin
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _refuse_growth(node, origin)
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _refuse_growth(node: yaml.Node, origin: str) -> None:
    """Refuse aliases that multiply a document beyond `LARGEST`, and an alias inside its own anchor.

    Raises:
        FormatError: With the line of the anchor.
    """
    sizes: dict[int, int | None] = {}

    def size(part: yaml.Node) -> int:
        """Return the number of nodes that a node becomes with its aliases written out."""
        if isinstance(part, yaml.ScalarNode):
            return 1
        # None marks a node whose inside is being counted: meeting it again is a circle.
        count = sizes.get(id(part), 0)
        line = part.start_mark.line + 1
        if count is None:
            raise FormatError(f"{origin}: line {line} contains itself by an alias", "a finite document", "write it out")
        if not count:
            sizes[id(part)] = None
            inside = (
                part.value if isinstance(part, yaml.SequenceNode) else [node for pair in part.value for node in pair]
            )
            count = 1 + sum(map(size, inside))
            sizes[id(part)] = count
        if count > LARGEST:
            raise FormatError(
                f"{origin}: with its aliases the document has {count:.3g} values from line {line} on",
                f"at most {LARGEST:,} values",
                "write the values without aliases inside aliases",
            )
        return count

    size(node)


def _nested(text: str) -> int:
    """Return a bound on how deep brackets and rows of dashes go; deeper by indentation alone is a long text."""
    levels = list(accumulate((1 if bracket in "[{" else -1 for bracket in _BRACKETS.findall(text)), initial=0))
    return max(levels) - min(levels) + max((len(row) for row in _DASHES.findall(text)), default=0)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a JSON text; duplicate keys are left to `_Loader`, which knows the lines."""
    content = {composed(name): value for name, value in pairs}
    if len(content) < len(pairs):
        raise ValueError("a key twice")
    return content


def composed(text: str) -> str:
    """Return a text in Unicode's composed form (NFC): some systems write an umlaut as two characters."""
    return unicodedata.normalize("NFC", text)


def _referring(content: Any) -> Any:
    """Return a document whose texts that mean one of its keys are written as that key is."""
    keys: set[str] = set()

    def collect(part: Any) -> bool:
        """Add the keys of a part; return whether a text in it is decomposed."""
        if isinstance(part, dict):
            keys.update(key for key in part if isinstance(key, str))
            return sum(collect(value) for value in part.values()) > 0
        if isinstance(part, list):
            return sum(collect(value) for value in part) > 0
        return isinstance(part, str) and not unicodedata.is_normalized("NFC", part)

    def named(part: Any) -> Any:
        if isinstance(part, dict):
            return {key: named(value) for key, value in part.items()}
        if isinstance(part, list):
            return [named(value) for value in part]
        return composed(part) if isinstance(part, str) and composed(part) in keys else part

    return named(content) if collect(content) else content


class _Constructor:
    """YAML 1.2's numbers (``1e-7``, ``010`` is ten, ``1:30`` is a text), and no duplicate keys."""

    origin = ""
    construct_object: Any
    construct_scalar: Any

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
            if isinstance(name, str):
                name = key.value = composed(name)
            if not isinstance(name, Hashable):
                raise FormatError(
                    f"{self.origin}: line {line}: a list or mapping as a key", "a text or a number", "correct the key"
                )
            if name in lines:
                places = f"in line {lines[name]} and in line {line}" if lines[name] != line else f"in line {line}"
                raise FormatError(
                    f"{self.origin}: {name!r} is given twice, {places}",
                    "each key once",
                    "delete or rename one of the two",
                )
            lines[name] = line
        return super().construct_mapping(node, deep)  # ty: ignore[missing-attribute]

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """Return a whole number: decimal, 0x hexadecimal or 0o octal."""
        text = str(self.construct_scalar(node))
        return int(text, 0) if text.lstrip("-+").startswith(("0x", "0o")) else int(text)


class _Loader(_Constructor, yaml.SafeLoader):
    """In Python: its errors describe the fault."""


_NUMBERS = list("-+0123456789.")
_INT, _FLOAT = (f"tag:yaml.org,2002:{kind}" for kind in ("int", "float"))
_RESOLVERS = {
    _INT: re.compile(r"(?:[-+]?[0-9]+|0x[0-9a-fA-F]+|0o[0-7]+)$"),
    _FLOAT: re.compile(
        r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)$|[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$"
        r"|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"
    ),
}


def _with_numbers(loader: Any) -> Any:
    """Give a loader the numbers of YAML 1.2: YAML 1.1 read 010 as eight, 1:30 as ninety and 1_0 as ten."""
    loader.yaml_implicit_resolvers = {
        letter: [entry for entry in entries if entry[0] not in _RESOLVERS]
        for letter, entries in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    for tag, pattern in _RESOLVERS.items():
        loader.add_implicit_resolver(tag, pattern, _NUMBERS)
    loader.add_constructor(_INT, loader.construct_yaml_int)
    return loader


_with_numbers(_Loader)
_QuickLoader: Any = None
if yaml.__with_libyaml__:
    _QuickLoader = _with_numbers(type("_QuickLoader", (_Constructor, yaml.CSafeLoader), {}))
"""The same by libyaml, where PyYAML was built with it."""
LARGEST = 1_000_000
"""Most values of a document with its aliases written out."""
DEEP = 200
"""Levels from which libyaml could run out of stack; the loader in Python ends in words."""
_BRACKETS, _DASHES = re.compile(r"[\[{}\]]"), re.compile(r"(?:[-?] +)+")


def check(document: Any, schema: str, origin: str) -> None:
    """Check a document against ``schemas/<schema>.schema.json``; ``origin`` names it in the error.

    Raises:
        FormatError: Naming the first offending field, its value and the allowed ones.
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
    # By place, so that the same file always reports the same fault first.
    errors = sorted(Draft202012Validator(definition).iter_errors(document), key=lambda e: list(e.absolute_path))
    if errors:
        first = errors[0]
        field = "/".join(str(part) for part in first.absolute_path) or "the document"
        unit = first.schema.get("unit", "") if isinstance(first.schema, dict) else ""
        hint = first.schema.get("description", "") if isinstance(first.schema, dict) else ""
        raise FormatError(
            f"{origin}: {field}: {_shortened(first.message)}" + (f" [{unit}]" if unit else ""),
            hint or f"what schemas/{schema}.schema.json says of {field}",
            f"change {field} and run again",
        )


LONGEST = 300
"""Most letters of a validator's message that an error repeats."""


def _shortened(text: str) -> str:
    """Return a message without its middle, where it quotes a long value."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


def write_text(path: Path, text: str) -> None:
    """Write a file so that a crash leaves either the old one or the new one.

    Raises:
        DeviceError: If the disk refuses it.
    """
    try:
        with replacement(path) as stream:
            stream.write(text.encode())
    except OSError as error:
        reason = refused_by_system(error)
        allowed, remedy = (reason.allowed, reason.remedy) if reason else (WRITABLE, "choose another folder")
        raise DeviceError(f"writing {path} failed: {error}", allowed, remedy) from error


def write(path: Path, document: dict[str, Any], schema: str) -> None:
    """Check a document and write it, as YAML or JSON by the file's ending."""
    check(document, schema, str(path))
    as_yaml = path.suffix in (".yaml", ".yml")
    # Keys stay in the order in which a person reads them.
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True) if as_yaml else json.dumps(document, indent=1)
    write_text(path, text + ("" if text.endswith("\n") else "\n"))
