"""Folders as registries: a member's name is its file's name, and listing imports nothing.

Members come from three places, in this order:

- the room's own folder;
- plug-in folders, laid out as ``FOLDER/ROOM/my_member.py``, for example ``lab/devices/my_board.py``. A rig or sensor
  file names one (``plugins: lab``); so do ``pyproject.toml`` where the command runs, the variable `VARIABLE`, and
  `add_folder`;
- installed distributions, by entry points of the group ``tacdata.ROOM``: ``my_board = "lab_tools.my_board"``.

``ROOM`` is the room's last name: ``devices``, ``effects``, ``indenters``, ``materials``, ... (``tacdata list``).
"""

from __future__ import annotations

import difflib
import importlib
import os
import pkgutil
import sys
import tomllib
from collections.abc import Set
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath

VARIABLE = "TACDATA_PLUGINS"
"""Environment variable with the plug-in folders, separated as in ``PATH``; worker processes inherit it."""
GROUP = "tacdata."
"""Groups of entry points begin so."""
HELP = "docs/how_to/plug_ins.md"
KINDS = frozenset(
    "adhesions commands devices effects exporters formats indenters kinds laws materials networks portraits principles "
    "shipped splits strategies".split()
)
"""Folders in a plug-in folder."""
MISTAKEN = {"verbs": "commands"} | {kind.removesuffix("s"): kind for kind in KINDS}
"""Names of folders that mean one of `KINDS`."""


def add_folder(folder: StrPath) -> None:
    """Add a plug-in folder for this process and the processes that it starts.

    Raises:
        UsageError: If there is no such folder, or no folder of a kind in it (`KINDS`).
    """
    place = Path(folder).resolve()
    _check_folder(place)
    folders = os.environ.get(VARIABLE, "")
    if str(place) not in folders.split(os.pathsep):
        os.environ[VARIABLE] = os.pathsep.join(filter(None, (folders, str(place))))


def _check_folder(folder: Path) -> None:
    """Refuse a plug-in folder that is not there, has no folder of a kind, or one under a name that means another."""
    # A folder that is not there holds none, and is refused by the same words.
    inside = {each.name for each in folder.iterdir() if each.is_dir()} if folder.is_dir() else set()
    kinds = f"folders named {', '.join(sorted(KINDS))}"
    for name in sorted(inside & MISTAKEN.keys()):
        raise UsageError(f"the folder of plug-ins {folder} holds {name}", kinds, f"rename it to {MISTAKEN[name]}")
    if not inside & KINDS:
        raise UsageError(
            f"{folder} is no folder of plug-ins", kinds, f"make devices/my_board.py in it; {HELP} explains it"
        )


def add_project(folder: Path) -> None:
    """Add the plug-in folders that the ``pyproject.toml`` of a folder names under ``[tool.tacdata]``, if it has one.

    Raises:
        UsageError: If a folder is not there.
        FormatError: If the file is damaged, or names something else than folders.
    """
    path = folder / "pyproject.toml"
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    # Without this section nothing is parsed: other faults of a project's file are not reported here.
    if "[tool.tacdata]" not in text:
        return
    try:
        named = tomllib.loads(text)["tool"]["tacdata"].get("plugins", [])
    except ValueError as error:
        raise FormatError(f"{path} is not readable as TOML: {error}", "a pyproject.toml", "correct it") from None
    if not isinstance(named, list) or not all(isinstance(each, str) for each in named):
        raise FormatError(f"{path}: plugins = {named!r} under [tool.tacdata]", 'folders: ["lab"]', "correct it")
    for each in named:
        add_folder(folder / each)


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
    # By the names of files: no member is imported, as many need packages of an extra.
    files = {module.name for module in pkgutil.iter_modules(_search_path(room))} - {base, "__init__"}
    return sorted(files | _installed(room).keys())


def folders(room: str) -> tuple[str, ...]:
    """Return the folders in which a room's members lie."""
    _import_room(room)
    return tuple(_search_path(room))


def has(room: str, base: str, name: str) -> bool:
    """Return whether a room has a member of this name; nothing is imported but the room."""
    if name in (base, "__init__") or not name.isidentifier():
        return False
    return _has_file(room, name) or name in _installed(room)


def source(room: str, name: str) -> Path:
    """Return the file of a member, which is not imported.

    Raises:
        UsageError: If it has none.
    """
    for folder in _search_path(room):
        for path in (Path(folder) / f"{name}.py", Path(folder) / name / "__init__.py"):
            if path.is_file():
                return path
    spec = find_spec(_installed(room)[name].value) if name in _installed(room) else None
    # A package without a file of its own (a namespace) has nothing to show.
    if spec is None or spec.origin is None:
        raise UsageError(f"no file of {name} in {room}", "a member with a source file", "install its package again")
    return Path(spec.origin)


def plug_ins(room: str) -> dict[str, Path]:
    """Return the source files of the members that do not ship with tacdata, by name."""
    places = _plug_in_places(room, os.environ.get(VARIABLE, ""))
    files = {module.name for module in pkgutil.iter_modules(places)}
    return {name: source(room, name) for name in sorted(files | _installed(room).keys())}


def load_module(room: str, base: str, name: str) -> ModuleType:
    """Import one member of a room.

    Raises:
        UsageError: If there is no member of that name, or its entry point does not fit.
    """
    # Asked by its name: listing the folder for each of its members would read it as often as it has members.
    if not has(room, base, name):
        members = names(room, base)
        close = difflib.get_close_matches(name, members, n=1)
        kind = _kind(room)
        raise UsageError(
            f"{name!r} is not among the {kind}",
            ", ".join(members),
            f"did you mean {close[0]!r}?" if close else f"choose one, or add {kind}/{name}.py as a plug-in ({HELP})",
        )
    if _has_file(room, name):
        # As part of the room, whose package searches the plug-in folders too.
        return importlib.import_module(f"{room}.{name}")
    return _load_installed(_installed(room)[name])


def load[T](room: str, base: str, name: str, kind: type[T]) -> type[T]:
    """Import one member and return its only public class derived from ``kind``."""
    module = load_module(room, base, name)
    classes = public_classes(module, kind)
    if len(classes) != 1:
        raise UsageError(
            f"{module.__name__} defines {len(classes)} public classes derived from {kind.__name__}",
            "exactly one",
            "keep one class per file; variants are parameters",
        )
    return classes[0]


def public_classes[T](module: ModuleType, kind: type[T]) -> list[type[T]]:
    """Return the public classes that a file defines and that are derived from ``kind``, in the order of the file."""
    classes = [value for value in vars(module).values() if isinstance(value, type) and issubclass(value, kind)]
    return [each for each in classes if each.__module__ == module.__name__ and not each.__name__.startswith("_")]


def _kind(room: str) -> str:
    return room.rsplit(".", 1)[-1]


def _import_room(room: str) -> None:
    """Import a room, and let its package search the plug-in folders too."""
    path = importlib.import_module(room).__path__
    for place in _plug_in_places(room, os.environ.get(VARIABLE, "")):
        if place not in path:
            path.append(place)


def _has_file(room: str, name: str) -> bool:
    _import_room(room)
    return find_spec(f"{room}.{name}") is not None


def _search_path(room: str) -> list[str]:
    """Return a room's folders; the room itself may need a package that is not installed, and is not imported."""
    spec = find_spec(room)
    shipped = sys.modules[room].__path__ if room in sys.modules else spec.submodule_search_locations if spec else None
    return list(dict.fromkeys([*(shipped or ()), *_plug_in_places(room, os.environ.get(VARIABLE, ""))]))


@cache
def _plug_in_places(room: str, variable: str) -> tuple[str, ...]:
    """Return the folders of a room's plug-ins.

    Raises:
        UsageError: If there is no such folder, or a plug-in has the name of a member that ships.
    """
    named = [Path(folder) for folder in variable.split(os.pathsep) if folder]
    for folder in named:
        _check_folder(folder)
    places = [str(folder / _kind(room)) for folder in named if (folder / _kind(room)).is_dir()]
    for place in places:
        _refuse_shipped({module.name for module in pkgutil.iter_modules([place])}, room, place)
    return tuple(places)


def _refuse_shipped(plugged: Set[str], room: str, origin: str) -> None:
    """Refuse plug-ins that have the name of a member that ships."""
    spec = find_spec(room)
    # The first folder is the room's own; those of plug-ins follow.
    shipped = list(spec.submodule_search_locations or ())[:1] if spec else []
    if conflicts := plugged & {module.name for module in pkgutil.iter_modules(shipped)}:
        problem = f"{origin} holds {min(conflicts)}, and tacdata ships {_kind(room)}/{min(conflicts)}"
        raise UsageError(problem, "a name that is not taken", "rename the plug-in")


@cache
def _entry_points() -> EntryPoints:
    """Return those of all packages: reading them takes longer than importing a room."""
    return entry_points()


@cache
def _installed(room: str) -> dict[str, EntryPoint]:
    """Return the entry points of a room, by name."""
    points = {point.name: point for point in _entry_points().select(group=f"{GROUP}{_kind(room)}")}
    if points:
        _refuse_shipped(points.keys(), room, f"an entry point of {GROUP}{_kind(room)}")
    return points


def _load_installed(point: EntryPoint) -> ModuleType:
    if point.value.rsplit(".", 1)[-1] != point.name or ":" in point.value:
        raise UsageError(
            f"entry point {point.name} = {point.value!r} of {point.group}",
            f"a module of the same name, such as my_package.{point.name}",
            "correct it in the distribution that brings it",
        )
    try:
        return importlib.import_module(point.value)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"entry point {point.name} = {point.value!r} of {point.group}: {error}",
            "a module that is installed",
            "install its distribution again",
        ) from error
