"""What is installed is what the constraints say, and nothing is written twice."""

import ast
import re
import sys
from importlib.metadata import distributions, packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROJECT = (ROOT / "pyproject.toml").read_text()
PINS = [line for line in (ROOT / ".dev" / "constraints.txt").read_text().splitlines() if not line.startswith("#")]


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def test_constraints_hold_names_and_versions_only():
    """No address of any index may be written down."""
    assert len(PINS) > 50
    assert not [line for line in PINS if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*==[A-Za-z0-9.!+]+", line)]


def test_every_dependency_is_pinned():
    wanted = {canonical(name) for name in re.findall(r'^    "([A-Za-z0-9._-]+)(?:\[[a-z]+\])?[><=~]', PROJECT, re.M)}
    assert len(wanted) > 20
    assert not wanted - {canonical(line.split("==")[0]) for line in PINS}


def test_one_opencv():
    """Two distributions of different releases that both write cv2/ would mix (docs/decisions/0004)."""
    found = {d.metadata["Name"]: d.version for d in distributions() if d.metadata["Name"].lower().startswith("opencv")}
    assert "opencv-contrib-python-headless" in found
    assert len(set(found.values())) == 1, found


def test_what_is_installed_is_what_is_pinned():
    """Scores and labels depend on the versions; pins that nobody runs would be a fiction."""
    pins = {canonical(name): pin for name, pin in (line.split("==") for line in PINS)}
    found = {canonical(d.metadata["Name"]): d.version.split("+")[0] for d in distributions()}
    assert {"torch", "lerobot", "warp-lang", "rerun-sdk"} <= pins.keys() & found.keys()
    differing = {name: (pin, found[name]) for name, pin in pins.items() if found.get(name, pin) != pin}
    assert not differing, "run sh .dev/environment, or sh .dev/refresh-constraints if the new ones are wanted"


def test_every_import_is_declared():
    """A package that only comes along with another one may leave with it."""
    declared = {canonical(name) for name in re.findall(r'^    "([A-Za-z0-9._-]+)', PROJECT, re.M)}
    own = {"tacdata", "schemas", "label_farm", "training", "viewers"}
    providers = packages_distributions()
    undeclared = {}
    for package in own:
        for path in (ROOT / package).rglob("*.py"):
            for module in imported(path) - set(sys.stdlib_module_names) - own:
                if not {canonical(name) for name in providers.get(module, [])} & declared:
                    undeclared.setdefault(module, set()).add(path.relative_to(ROOT).as_posix())
    assert not undeclared


def imported(path):
    """Return the top-level packages that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found
