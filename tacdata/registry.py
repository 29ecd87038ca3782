"""Folders as registries: a member's name is its file's name, and listing imports nothing."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
import sys
from importlib.util import find_spec
from types import ModuleType

from tacdata.errors import UsageError


def names(room: str, base: str) -> list[str]:
    """Return the members of a room, sorted, without importing any of them.

    Args:
        room: Dotted package name, for example ``"tacdata.indenters"``.
        base: File name of the room's base class, which is no member.

    Example:
        >>> from tacdata import registry
        >>> registry.names("tacdata.indenters", "indenter")[:3]
        ['cone', 'cylinder', 'ellipsoid']
    """
    spec = find_spec(room)  # the room itself may need a package that is not installed
    places = spec.submodule_search_locations if spec else None
    if room in sys.modules:
        places = sys.modules[room].__path__  # a folder may have been added
    return sorted(m.name for m in pkgutil.iter_modules(places) if m.name not in (base, "__init__")) if places else []


def folders(room: str) -> tuple[str, ...]:
    """Return the folders in which a room's members lie. Append to the package's ``__path__`` to add one."""
    return tuple(importlib.import_module(room).__path__)


def has(room: str, base: str, name: str) -> bool:
    """Return whether a room has a member of this name; nothing is imported but the room."""
    return name not in (base, "__init__") and name.isidentifier() and find_spec(f"{room}.{name}") is not None


def load_module(room: str, base: str, name: str) -> ModuleType:
    """Import one member of a room.

    Raises:
        UsageError: If no file of that name lies in the room.
    """
    # Asked by its name: listing the folder for each of its members would read it as often as it has members.
    if not has(room, base, name):
        known = names(room, base)
        close = difflib.get_close_matches(name, known, n=1)
        kind = room.rsplit(".", 1)[-1]
        raise UsageError(
            f"{name!r} is not among the {kind}",
            ", ".join(known),
            f"did you mean {close[0]!r}?" if close else f"choose one, or add {room.replace('.', '/')}/{name}.py",
        )
    return importlib.import_module(f"{room}.{name}")


def load[T](room: str, base: str, name: str, kind: type[T]) -> type[T]:
    """Import one member and return its only public class derived from ``kind``."""
    module = load_module(room, base, name)
    found = [
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, kind)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    ]
    if len(found) != 1:
        raise UsageError(
            f"{module.__name__} defines {len(found)} public classes derived from {kind.__name__}",
            "exactly one",
            "keep one class per file; variants are parameters",
        )
    return found[0]
