"""Which extra of the install brings a package that is missing, read from tacdata's own metadata."""

from __future__ import annotations

import json
import re
from importlib.metadata import PackageNotFoundError, distribution, requires
from types import TracebackType

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tacdata.errors import PackageError

IMPORTED_AS = {
    "cv2": "opencv-contrib-python-headless",
    "markdown_it": "markdown-it-py",
    "nptdms": "npTDMS",
    "rerun": "rerun-sdk",
    "warp": "warp-lang",
}
"""Packages that are imported by another name than they are installed by."""
ALL = "all"
"""The extra that brings everything: never the least that is needed."""
ROOMS = {
    "tacdata.revision": "fem",
    "tacdata.studio": "view",
    "tacdata.training": "learn",
    "tacdata.pipeline.evaluate": "learn",
    "tacdata.pipeline.train": "learn",
    "tacdata.pipeline.trained_network": "learn",
    "tacdata.viewers": "view",
}
"""Who asks decides, where two extras bring the same package: torch solves for `fem` and trains for `learn`."""


def missing_package(error: ImportError, feature: str, instead: str = "") -> PackageError | None:
    """Return the message for a package that is not installed; None if no extra brings it.

    Args:
        error: Error of the import.
        feature: Who needs the package, for example ``"tacdata label"``.
        instead: Alternative to installing it.
    """
    if not isinstance(error, ModuleNotFoundError) or not error.name:
        return None
    module = error.name.split(".")[0]
    package = IMPORTED_AS.get(module, module)
    extras = extras_of(package)
    if not extras:
        return None
    rooms = (room for asker in _askers(error.__traceback__) for room in ROOMS if f"{asker}.".startswith(f"{room}."))
    # The outermost room that the import came from knows what the person wanted.
    extra = next((ROOMS[room] for room in rooms if ROOMS[room] in extras), extras[0])
    name = package if package == module else f"{module.capitalize()} ({package})"
    line = install_line(extra)
    return PackageError(
        f"{feature} needs {name}, which is not installed",
        f"an install with the extra {extra}",
        f"{line}, or {instead}" if instead else line,
    )


def require(extras: tuple[str, ...], asker: str) -> None:
    """Check that every package of some extras is installed, without importing any.

    Args:
        extras: Names of extras.
        asker: Verb that needs them, for example ``"tacdata demo"``.

    Raises:
        PackageError: If a package is missing.
    """
    for extra in extras:
        if absent := [package for package in packages_of(extra) if not _installed(package)]:
            raise PackageError(
                f"{asker} needs {', '.join(absent)}, which {'is' if len(absent) == 1 else 'are'} not installed",
                f"an install with the extras {', '.join(extras)}",
                install_line(",".join(extras)),
            )


def packages_of(extra: str) -> tuple[str, ...]:
    """Return the packages that an extra brings on this platform."""
    brought = [r for r in _requirements() if r.marker and r.marker.evaluate({"extra": extra})]
    return tuple(r.name for r in brought if not _plain(r))


def _requirements() -> list[Requirement]:
    """Return the packages of all extras and of the plain install; none where tacdata is not installed."""
    try:
        return [Requirement(line) for line in requires("tacdata") or ()]
    except PackageNotFoundError:
        return []


def _plain(requirement: Requirement) -> bool:
    """Return whether the plain install brings a requirement too."""
    return requirement.marker is None or requirement.marker.evaluate({"extra": ""})


def _installed(package: str) -> bool:
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


def install_line(extra: str) -> str:
    """Return the command that installs an extra from where this install came: a clone, a file, or the package index."""
    try:
        record = distribution("tacdata").read_text("direct_url.json")
    except PackageNotFoundError:
        return f"pip install '.[{extra}]' in the clone"
    if record is None:
        return f"pip install 'tacdata[{extra}]'"
    origin = json.loads(record)
    if "dir_info" in origin:
        return f"pip install '.[{extra}]' in the clone"
    # As pip takes it: git+https://...
    system = f"{origin['vcs_info']['vcs']}+" if "vcs_info" in origin else ""
    return f"pip install 'tacdata[{extra}] @ {system}{origin['url']}'"


def extras_of(package: str) -> tuple[str, ...]:
    """Return the extras that bring a package, sorted, without the one that brings everything."""
    name = canonicalize_name(package)
    markers = (str(r.marker) for r in _requirements() if canonicalize_name(r.name) == name)
    found = (re.search(r"extra == ['\"]([\w-]+)['\"]", marker) for marker in markers)
    return tuple(sorted({extra[1] for extra in found if extra} - {ALL}))


def _askers(trace: TracebackType | None) -> list[str]:
    """Return the modules that an error passed through, the outermost first: the first room among them asked."""
    modules = []
    while trace is not None:
        modules.append(trace.tb_frame.f_globals.get("__name__", ""))
        trace = trace.tb_next
    return modules
