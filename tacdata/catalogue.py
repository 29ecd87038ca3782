"""Lists the registries from their sources: no import of a member, no driver, no GPU."""

from __future__ import annotations

import ast
import difflib
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from tacdata import registry
from tacdata.errors import UsageError

TYPED = {"commands": "verbs"}
"""Folders with another name in ``tacdata list``."""
PACKAGES = ("tacdata", "tacdata.label_farm", "tacdata.training", "tacdata.viewers")


@dataclass(frozen=True)
class Registry:
    """A folder whose files are members."""

    name: str
    """Name of the folder."""
    room: str
    """Dotted package name."""
    base: str
    """File name of the base class, whose docstring describes the contents of a member's file."""
    meaning: str
    """First line of the package's docstring."""


@dataclass(frozen=True)
class RegistryMember:
    """One file of a registry."""

    name: str
    """The file's name."""
    meaning: str
    """First line of its docstring."""
    parameters: tuple[tuple[str, str], ...]
    """Name and first line of the docstring of each public field of its classes."""


def registries() -> dict[str, Registry]:
    """Return every registry by name: a module that sets ``ROOM, BASE = "package", "base"`` declares one."""
    by_name = {}
    for path in (p for package in PACKAGES for p in sorted(_folder(package).rglob("*.py"))):
        text = path.read_text(encoding="utf-8")
        # Few files declare one, and parsing all of them takes a second.
        for node in ast.parse(text).body if "ROOM, BASE = " in text else ():
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "(ROOM, BASE)":
                room, base = ast.literal_eval(node.value)
                folder = room.rsplit(".", 1)[-1]
                name = TYPED.get(folder, folder)
                by_name[name] = Registry(name, room, base, _first_line(_parse(_folder(room) / "__init__.py")))
    return dict(sorted(by_name.items()))


def members(name: str) -> list[RegistryMember]:
    """Return the members of a registry, sorted by name.

    Raises:
        UsageError: If there is no such registry.
    """
    by_name = registries()
    if name not in by_name:
        close = difflib.get_close_matches(name, by_name, n=1)
        raise UsageError(
            f"no folder of members is called {name!r}",
            ", ".join(by_name),
            f"did you mean {close[0]!r}?" if close else "tacdata list shows them all",
        )
    room, base = by_name[name].room, by_name[name].base
    return [_member(room, member) for member in registry.names(room, base)]


def _member(room: str, name: str) -> RegistryMember:
    tree = _parse(registry.source(room, name))
    classes = [n for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_")]
    return RegistryMember(name, _first_line(tree), tuple(field for kind in classes for field in _fields(kind)))


def _fields(kind: ast.ClassDef) -> list[tuple[str, str]]:
    """Return name and first docstring line of the dataclass fields of a class."""
    if not any("dataclass" in ast.unparse(d) for d in kind.decorator_list):
        return []
    result = []
    # A field's docstring is the statement behind it.
    for statement, following in zip(kind.body, [*kind.body[1:], ast.Pass()], strict=True):
        if isinstance(statement, ast.AnnAssign) and not ast.unparse(statement.target).startswith("_"):
            value = following.value if isinstance(following, ast.Expr) else None
            text = str(value.value) if isinstance(value, ast.Constant) else ""
            result.append((ast.unparse(statement.target), text.strip().split("\n")[0]))
    return result


def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise UsageError(
            f"the package {package} is not installed", "an installation of tacdata", "install tacdata again"
        )
    return Path(next(iter(spec.submodule_search_locations)))


def _parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _first_line(tree: ast.Module) -> str:
    return (ast.get_docstring(tree) or "").split("\n")[0]
