"""What is long by nature runs when asked for, or when something changed that decides it.

A test says which rooms decide it and why it is long: `@pytest.mark.long("label_farm", reason="workers die at random")`.
`pytest --long=all` runs these tests alone. `--long=changed` runs the files whose inputs differ from those at which they
last passed. Inputs are the rooms named, what they import in turn, the test, its helpers and pinned versions. Left out
are docstrings, comments and the versions of checkers. Of a page that is named they are what it shows to type. A run in
which all long tests of a file pass writes a hash of its inputs to `long_runs.json`.
"""

import ast
import functools
import hashlib
import json
import sys
import time
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECORD = Path(__file__).with_name("long_runs.json")
PACKAGES = ("tacdata", "label_farm", "training", "viewers", "schemas")
CHECKERS = ("grimp", "import-linter", "ruff", "ty")
"""Pinned packages that decide no test."""


def pytest_addoption(parser):
    """Add the option that asks for the long part."""
    parser.addoption("--long", choices=("all", "changed"), help="run what is long by nature, and only that")


def pytest_configure(config):
    """Declare the mark; write down what passed where the tests report to."""
    config.addinivalue_line(
        "markers", "long(*rooms, reason): `sh .dev/test --long` runs it, or CI when one of its rooms changed"
    )
    if config.option.long and not config.option.collectonly and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Passed(config))


def pytest_ignore_collect(collection_path, config):
    """Import no file that has no long test, if those alone are asked for."""
    if config.option.long and collection_path.match("test_*.py") and "mark.long" not in collection_path.read_text():
        return True
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Leave out the long tests, or all others."""
    rooms = defaultdict(set)
    for item in items:
        for mark in item.iter_markers("long"):
            rooms[item.nodeid.split("::")[0]] |= set(mark.args)
            item.user_properties.append(("rooms", " ".join(mark.args)))
    known = record()

    def wanted(item):
        if item.get_closest_marker("long") is None:
            return not config.option.long
        if config.option.long != "changed":
            return config.option.long == "all"
        # Inputs are hundreds of files: seconds, in each process that runs tests.
        file = item.nodeid.split("::")[0]
        return known.get(file, {}).get("inputs") != inputs(file, tuple(sorted(rooms[file])))

    left_out = [item for item in items if not wanted(item)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]


def record():
    """Return what passed when, by file."""
    return json.loads(RECORD.read_text())


def seconds():
    """Return what the long tests of each file took when they last passed [s]."""
    return {file: float(passed["seconds"]) for file, passed in record().items()}


class Passed:
    """Collects what became of the long tests; writes down the files of which all passed."""

    def __init__(self, config):
        self.whole = not any("::" in argument for argument in config.args) and not config.option.keyword
        self.asked = [config.invocation_params.dir / argument.split("::")[0] for argument in config.args]
        self.changed = config.option.long == "changed" and not config.option.maxfail
        self.files = defaultdict(lambda: {"rooms": set(), "outcomes": set(), "seconds": 0.0})

    def pytest_runtest_logreport(self, report):
        """Note a phase."""
        file = self.files[report.nodeid.split("::")[0]]
        file["rooms"] |= {room for name, rooms in report.user_properties if name == "rooms" for room in rooms.split()}
        file["seconds"] += report.duration
        if report.outcome != "rerun":
            file["outcomes"].add(report.outcome)

    def pytest_terminal_summary(self, terminalreporter):
        """Say what ran and what was left as it passed before, and write down what passed."""
        known = record()
        terminalreporter.section("long part")
        for name, file in sorted(known.items()):
            if name not in self.files and self.left_as_passed(ROOT / name):
                terminalreporter.write_line(f"not run: {name}: passed on {file['on']} with these inputs")
        for name, file in sorted(self.files.items()):
            passed = file["outcomes"] == {"passed"}
            word = "failed" if "failed" in file["outcomes"] else "passed" if passed else "skipped, some or all,"
            terminalreporter.write_line(f"{word} in {file['seconds']:.0f} s: {name}")
            if passed and self.whole:
                rooms = tuple(sorted(file["rooms"]))
                known[name] = {
                    "inputs": inputs(name, rooms),
                    "rooms": rooms,
                    "on": time.strftime("%Y-%m-%d"),
                    "seconds": round(file["seconds"]),
                }
        if self.whole:
            RECORD.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")

    def left_as_passed(self, path):
        """Return whether a file with no report was asked for: then it was left out for its inputs alone."""
        asked = any(path.is_relative_to(place) for place in self.asked)
        return self.changed and self.whole and asked and path.exists()


@functools.cache
def inputs(file, rooms):
    """Return a hash of all that decides the long tests of a file."""
    room = ROOT / "tests" / (ROOT / file).relative_to(ROOT / "tests").parts[0]
    beside = {path for path in _texts(room) if not path.name.startswith("test_")}
    paths = {ROOT / file, *beside}
    for room in sorted(closure(rooms)):
        paths |= _texts(ROOT / room)
    pinned = (ROOT / ".dev" / "constraints.txt").read_text().splitlines()
    whole = hashlib.sha256("\n".join(line for line in pinned if line.split("==")[0] not in CHECKERS).encode())
    for path in sorted(paths):
        whole.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + _content(path) + b"\0")
    return whole.hexdigest()


def closure(rooms):
    """Return the rooms and all rooms that they import in turn."""
    found, todo = set(), set(rooms)
    while todo:
        found.add(room := todo.pop())
        todo |= set().union(*(_imported(path) for path in _texts(ROOT / room) if path.suffix == ".py")) - found
    return found


def _texts(place):
    if place.is_file():
        return {place}
    return {path for path in place.rglob("*") if path.is_file() and path.suffix not in (".md", ".pyc")}


@functools.cache
def _imported(path):
    """Return the rooms, as folders or single files, that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        found |= {room for name in names if (room := _room(name.split(".")))}
    return found


def _room(words):
    if words[0] != "tacdata":
        return None
    if words[1:2] and words[1] in PACKAGES:
        return words[1]
    place = Path("tacdata", *words[1:2])
    return place.as_posix() if (ROOT / place).is_dir() else place.with_suffix(".py").as_posix()


@functools.cache
def _content(path):
    """Return what of a file can decide a test: of Python its syntax tree without docstrings, of a page its blocks."""
    if path.suffix == ".md":
        from running.typed_pages import BLOCK  # not found where this file is run as a script

        return "".join(block[0] for block in BLOCK.finditer(path.read_text())).encode()
    if path.suffix != ".py":
        return path.read_bytes()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            # Docstrings of fields are text within the body: they do nothing, too.
            node.body = [line for line in node.body if not _is_text(line)]
    return ast.dump(tree).encode()


def _is_text(node):
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


if __name__ == "__main__":
    sys.exit(print(*sorted(closure(sys.argv[1:])), sep="\n"))
