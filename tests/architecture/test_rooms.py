"""Every room explains itself, is small, and has a name that says what it holds."""

import csv
import re
from collections import Counter, defaultdict
from pathlib import Path

import pytest

from tacdata import registry

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("tacdata", "schemas", "label_farm", "training", "viewers")
ROOMS = sorted({p.parent for package in PACKAGES for p in (ROOT / package).rglob("__init__.py")} - {ROOT / "tacdata"})
FILES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py") if not p.name.endswith("_pb2.py"))
TESTS = sorted(p for p in (ROOT / "tests").rglob("*") if p.is_dir() and any(p.glob("test_*.py")))
"""Rooms of tests; `tests` itself has one for each room of the code."""
MOST_LINES, LONGEST_LINE = 40, 140
"""Of a room's README; a row of a table may be longer."""
MOST_ENTRIES = 15
CEILINGS = Path(__file__).with_name("library_lines.csv")
"""Most lines of Python of each room, and of all together."""
SLACK = 0.05
"""Share of a ceiling that may stay unused before it is lowered."""
MEANINGLESS = {"utils", "util", "common", "helpers", "helper", "misc", "manager", "base"}


def name(path):
    return path.relative_to(ROOT).as_posix()


def members():
    """Return the members of every registry, by the room that holds them; a schema is one of its room."""
    found = defaultdict(set, schemas={path.name.split(".")[0] for path in (ROOT / "schemas").glob("*.schema.json")})
    for path in FILES:
        if match := re.search(r'^ROOM, BASE = "([\w.]+)", "(\w+)"', path.read_text(), re.M):
            room, base = match.groups()
            found[name((ROOT / room.replace(".", "/")).resolve())] |= set(registry.names(room, base))
    return found


def test_every_room_has_a_short_readme():
    """At most `MOST_LINES`, none so long that words were squeezed into it."""
    wrong = {}
    for room in ROOMS:
        lines = (room / "README.md").read_text().splitlines() if (room / "README.md").exists() else [""]
        if not lines[0].startswith("# "):
            wrong[name(room)] = "no README.md that begins with a title"
        if len(lines) > MOST_LINES:
            wrong[name(room)] = f"{len(lines)} lines"
        if long := [line for line in lines if len(line) > LONGEST_LINE and not line.startswith("|")]:
            wrong[name(room)] = f"a line of {len(long[0])} characters: {long[0]}"
    assert not wrong


def test_every_room_has_few_entries():
    """Members of a registry are not counted: who adds an effect copies one file and reads no other."""
    known, wrong = members(), {}
    for room in [*ROOMS, *TESTS]:
        entries = {path.name for path in room.iterdir()} - {"README.md", "__init__.py", "__pycache__", "py.typed"}
        others = {entry for entry in entries if entry.split(".")[0] not in known[name(room)]}
        if len(others) > MOST_ENTRIES:
            wrong[name(room)] = f"{len(others)} entries: give it sub-rooms"
    assert not wrong


@pytest.mark.parametrize("room", [r for r in ROOMS if name(r) in PACKAGES or r.parent == ROOT / "tacdata"], ids=name)
def test_a_room_stands_on_the_map(room):
    named = set()
    for entry in re.findall(r"^\| `([\w/, ]+)` \|", (ROOT / "ARCHITECTURE.md").read_text(), re.M):
        first, *others = entry.rstrip("/").split(", ")
        named |= {first, *(f"{first.rpartition('/')[0]}/{other}" for other in others)}
    assert name(room) in named


def test_every_file_has_one_subject():
    assert not [name(path) for path in FILES if path.stem in MEANINGLESS]
    lines = {name(path): len(path.read_text().splitlines()) for path in FILES}
    assert not {path: count for path, count in lines.items() if count > 400}


def test_most_files_are_small():
    lines = sorted(len(p.read_text().splitlines()) for p in FILES)
    assert lines[len(lines) // 2] <= 120


def test_no_room_grows():
    """A ceiling is only lowered, and their sum stays within the total (decision 0033)."""
    with CEILINGS.open(newline="") as file:
        ceilings = {row["room"]: int(row["lines"]) for row in csv.DictReader(file)}
    total, lines = ceilings.pop("total"), Counter()
    for path in FILES:
        parts = path.relative_to(ROOT).parts
        room = "/".join(parts[:2]) if parts[0] == "tacdata" and len(parts) > 2 else parts[0]
        lines[room] += len(path.read_text().splitlines())
    wrong = []
    for room in sorted({*lines, *ceilings}):
        count, ceiling = lines[room], ceilings.get(room, 0)
        if count > ceiling:
            remedy = (
                f"take {count - ceiling} out of it, or out of another room, and lower that one's ceiling by as many"
            )
            wrong.append(f"{room} has {count} lines, at most {ceiling}: {remedy}")
        elif count < (1 - SLACK) * ceiling - 10:
            wrong.append(f"{room} has {count} lines, at most {ceiling}: lower its ceiling to {round(1.01 * count)}")
    if sum(ceilings.values()) > total:
        wrong.append(f"the ceilings are {sum(ceilings.values())} lines, at most {total} together: lower one of them")
    assert not wrong, f"{CEILINGS.name}:\n" + "\n".join(wrong)


def test_readmes_name_only_files_that_exist():
    """A file named in backquotes lies at that path from the room or the top, or is a file of that name."""
    known = {path.name for folder in (*PACKAGES, "tests") for path in (ROOT / folder).rglob("*.*")}
    wrong = {}
    for room in ROOMS:
        text = (room / "README.md").read_text()
        named = {n for n in re.findall(r"`([\w/.-]+\.(?:py|proto|md))`", text) if not re.search(r"my_|your_", n)}
        if lost := {n for n in named if not ((room / n).exists() or (ROOT / n).exists() or n in known)}:
            wrong[name(room)] = lost
    assert not wrong


def test_every_registry_lists_without_importing():
    for path in FILES:
        if (match := re.search(r'^ROOM, BASE = "([\w.]+)", "(\w+)"', path.read_text(), re.M)) and match[2] == path.stem:
            room, base = match.groups()
            assert base not in registry.names(room, base)
            assert registry.names(room, base), f"{room} has no member"
