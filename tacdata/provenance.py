"""Who made this: content hashes, the code's version, and the stamp that every product carries."""

from __future__ import annotations

import ast
import hashlib
import json
import re
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from operator import itemgetter
from pathlib import Path
from typing import Any

_FARM = [
    "59c1258e2cd26f7d4d0a7cff4ae2a35df91e461fa26361e1222c87ae74816ded",
    "6281e5837cb8d35bac2449babfaca779592257e270400c737c160ffecf448ac6",
    "78a9489cf1a9c2e60f37af4beb2ef5160308766343ef2480205f18349d603238",
]
_ALIKE = "12 presses, 180 arrays: equal to the last bit"
EQUAL_VERSIONS: dict[str, tuple[Any, str]] = {
    # tacdata.skin, tacdata.indenters
    "1977f9099c306f209979b6bbd5f0329011656853c4e2acb9abe8cbc672db5f61": (
        "9d52ea98c6b708e1f5a724d14c8fcaf86a092e55882c91fa91b57574e8fd2629",
        _ALIKE,
    ),
    "65b40bc2bdc5b0d813864cdb37cf5b8eb6c7e78bb328c3616f73e36a61b04e65": (
        "e4c1d022f42d681255d4dc8438075601194e5828c16138807f71cbf19e06b149",
        f"{_ALIKE}; since then pair.py was added",
    ),
    # label_farm.presses: without spreads, with them
    "6a824e685eab6018c2b9362d1e76e5fcf2462d494270c0515279cf2d2f2c510a": (_FARM, _ALIKE),
    "5df0c127767136566545f3c453699fe976d4d9e088e6685f98e81bf3cb451b62": (_FARM, _ALIKE),
    # label_farm.labels
    "ae5e19a9ac1b765ded74fd73b9aa57b12860dff27eb1fb23e442c8e192ae25e8": (
        "c8cb8754334be9625504fedba56cf3dfe2f27bc6d95c42069666fca50d790fac",
        _ALIKE,
    ),
}
"""Version of code -> (its name in an older release, how it was shown that their results are identical).

Stored labels and solutions of the older release then stay current. An entry ends by itself: whoever changes the code
changes its version."""


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
    digest = hashlib.sha256()
    for each in names:
        for path, place in sorted(_sources(each).items(), key=itemgetter(1)):
            if path not in left_out:
                digest.update(f"{place}\0{_syntax(ast.parse(path.read_bytes()))}\0".encode())
    version = digest.hexdigest()
    name, _ = EQUAL_VERSIONS.get(version, (version, ""))
    return name


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
        return re.sub(r"\btacdata\.(?=(?:schemas|label_farm|training|viewers)\b)", "", node)
    if isinstance(node, str):
        # Their versions are those of releases that had these packages outside tacdata.
        return re.sub(r"\btacdata\.(?=(?:schemas|label_farm|training|viewers)\b)", "", node)
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
    carried = Path(__file__).resolve().with_name("commit.txt")
    if carried.is_file():
        return f"{release}+g{carried.read_text().strip()}"
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return release
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty=.dirty", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        ).stdout.strip()
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
