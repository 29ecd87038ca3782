"""Every room explains itself, is small, and has a name that says what it holds."""

import re
from pathlib import Path

import pytest

from tacdata import registry

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("tacdata", "schemas", "label_farm", "training", "viewers")
ROOMS = sorted({p.parent for package in PACKAGES for p in (ROOT / package).rglob("__init__.py")} - {ROOT / "tacdata"})
FILES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py") if not p.name.endswith("_pb2.py"))
MEANINGLESS = {"utils", "util", "common", "helpers", "helper", "misc", "manager", "base"}


def name(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("room", ROOMS, ids=name)
def test_a_room_has_a_short_readme(room):
    text = (room / "README.md").read_text()
    assert text.startswith("# ")
    assert len(text.splitlines()) <= 40


@pytest.mark.parametrize("room", [r for r in ROOMS if name(r) in PACKAGES or r.parent == ROOT / "tacdata"], ids=name)
def test_a_room_stands_on_the_map(room):
    named = set()
    for entry in re.findall(r"^\| `([\w/, ]+)` \|", (ROOT / "ARCHITECTURE.md").read_text(), re.M):
        first, *others = entry.rstrip("/").split(", ")
        named |= {first, *(f"{first.rpartition('/')[0]}/{other}" for other in others)}
    assert name(room) in named


@pytest.mark.parametrize("path", FILES, ids=name)
def test_a_file_has_one_subject(path):
    assert path.stem not in MEANINGLESS
    assert len(path.read_text().splitlines()) <= 400


def test_most_files_are_small():
    lines = sorted(len(p.read_text().splitlines()) for p in FILES)
    assert lines[len(lines) // 2] <= 120


@pytest.mark.parametrize("room", [r for r in ROOMS if (r / "README.md").exists()], ids=name)
def test_a_readme_names_only_files_that_exist(room):
    """A file named in backquotes lies at that path from the room or the top, or is a file of that name."""
    text = (room / "README.md").read_text()
    named = {n for n in re.findall(r"`([\w/.-]+\.(?:py|proto|md))`", text) if not re.search(r"my_|your_", n)}
    known = {path.name for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("*.*")}
    assert not {n for n in named if not ((room / n).exists() or (ROOT / n).exists() or n in known)}


def test_every_registry_lists_without_importing():
    for path in FILES:
        if (match := re.search(r'^ROOM, BASE = "([\w.]+)", "(\w+)"', path.read_text(), re.M)) and match[2] == path.stem:
            room, base = match.groups()
            assert base not in registry.names(room, base)
            assert registry.names(room, base), f"{room} has no member"
