"""Who made this: content hashes, the code's version, and the stamp that every product carries."""

from __future__ import annotations

import ast
import hashlib
import json
import re
import subprocess
import sys
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from operator import itemgetter
from pathlib import Path
from typing import Any

from tacdata import result_cache

EQUAL_VERSIONS: dict[str, tuple[Any, str]] = {}
"""Version of code -> (its name in an older release, how it was shown that their results are identical).

Stored labels and solutions of the older release then stay current. An entry ends by itself: whoever changes the code
changes its version."""


_MOVED = re.compile(r"\btacdata\.(?=(?:schemas|label_farm|training|viewers)\b)")
"""The package before names of rooms that were packages of their own."""


def canonical(document: Any) -> str:
    """Return the one JSON text of a document: sorted keys, no spaces, exact floats."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)


def content_hash(document: Any) -> str:
    """Return the SHA-256 of a document's canonical JSON (hex, 64 characters).

    Example:
        >>> from tacdata.provenance import content_hash
        >>> content_hash({"depth": 0.5, "speed": 1.0}) == content_hash({"speed": 1.0, "depth": 0.5})
        True
    """
    return hashlib.sha256(canonical(document).encode()).hexdigest()


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file's bytes (hex, 64 characters)."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def code_hash(*names: str, without: tuple[str, ...] = ()) -> Any:
    """Return the version of code that decides a result: a hash of its syntax (hex, 64 characters).

    Docstrings, comments and layout do not count. A version in `EQUAL_VERSIONS` goes by the older name given there.

    Args:
        names: Dotted names of modules and packages; a package counts with all of its modules.
        without: Modules and packages among these that decide nothing.
    """
    left_out = {path for name in without for path in _sources(name)}
    places = [each for name in names for each in sorted(_sources(name).items(), key=itemgetter(1))]
    sources = [(place, path.read_bytes()) for path, place in places if path not in left_out]
    # Parsing takes most of a second, so it is done once for the same bytes.
    key = _bytes_hash([("", Path(__file__).read_bytes()), *sources])
    version = result_cache.load("code", key)
    if not isinstance(version, str):
        digest = hashlib.sha256()
        for place, source in sources:
            digest.update(f"{place}\0{_syntax(ast.parse(source))}\0".encode())
        version = digest.hexdigest()
        result_cache.store("code", key, version)
    name, _ = EQUAL_VERSIONS.get(version, (version, ""))
    return name


def source_hash(*names: str) -> str:
    """Return the SHA-256 of the source files of modules and packages, comments included (hex, 64 characters)."""
    places = [each for name in names for each in sorted(_sources(name).items(), key=itemgetter(1))]
    return _bytes_hash([(place, path.read_bytes()) for path, place in places])


def _bytes_hash(sources: list[tuple[str, bytes]]) -> str:
    """Return the hash of named bytes, and of Python's release, whose parser reads them."""
    digest = hashlib.sha256(sys.version.encode())
    for place, source in sources:
        digest.update(f"\0{place}\0{len(source)}\0".encode() + source)
    return digest.hexdigest()


def _sources(name: str) -> dict[Path, str]:
    """Return the source files of a module or package, with their places in it."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"no module {name}")
    path = Path(spec.origin)
    if not spec.submodule_search_locations:
        return {path: path.name}
    return {each: each.relative_to(path.parent).as_posix() for each in path.parent.rglob("*.py")}


def _syntax(node: Any) -> Any:
    """Return a syntax tree as nested lists: without positions, empty fields, and docstrings."""
    if isinstance(node, list):
        # A docstring of a function or a field is such a text: it does nothing.
        return [_syntax(each) for each in node if not _stands_alone(each)]
    if isinstance(node, str):
        # Their versions are those of releases that had these packages outside tacdata.
        return _MOVED.sub("", node) if "tacdata." in node else node
    if not isinstance(node, ast.AST):
        return node
    # Which fields of a kind there are grows with Python's releases; their new ones are empty.
    return [type(node).__name__, *([k, _syntax(v)] for k, v in ast.iter_fields(node) if v not in (None, []))]


def _stands_alone(node: Any) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


@cache
def code_version() -> str:
    """Return the release and its commit, for example ``0.1.0+g1a2b3c4`` (``.dirty`` if edited).

    A clone is asked for the commit. A wheel carries the commit of its build (.dev/commit_hook.py).
    """
    try:
        release = version("tacdata")
    except PackageNotFoundError:
        release = "0+unknown"
    # A wheel has no repository to ask.
    carried = Path(__file__).resolve().with_name("commit.txt")
    if carried.is_file():
        return f"{release}+g{carried.read_text().strip()}"
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return release
    try:
        described = subprocess.run(
            ["git", "--no-optional-locks", "describe", "--always", "--dirty=.dirty", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        ).stdout.strip()
    # Without git, or in a damaged clone, the release alone is known.
    except (OSError, subprocess.SubprocessError):
        return release
    return f"{release}+g{described}"


def stamp(made_by: str, parents: dict[str, str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the provenance of a product.

    Args:
        made_by: The verb or function that made it.
        parents: Name to content hash of everything that it was made from.
        parameters: Settings that decided the result (JSON types).
    """
    return {
        "made_by": made_by,
        "code_version": code_version(),
        "made_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "parents": parents,
        "parameters": parameters,
    }
