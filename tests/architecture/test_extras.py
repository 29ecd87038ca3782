"""The plain install is enough for a rig and a first look; what needs more says which extra."""

import json
import re
import subprocess
import sys
from importlib.metadata import distribution, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

from tacdata import cli, extras
from tacdata.errors import Exit, PackageError
from tacdata.example.shipped import copy_session
from tacdata.extras import ALL, IMPORTED_AS, extras_of, missing_package

ROOT = Path(__file__).resolve().parents[2]
OWN = ("tacdata",)
HEAVY = {"torch", "warp", "mujoco", "mink", "lerobot", "vtkmodules", "pyvista", "rerun", "onnx", "onnxruntime", "cv2"}
ROOMS = {
    "tacdata.skin": "fem",
    "tacdata.surrogate": "fem",
    "tacdata.cases": "fem",
    "tacdata.revision": "fem",
    "tacdata.warp_runtime": "fem",
    "tacdata.chain.lanes": "fem",
    "tacdata.chain.memory_kernels": "fem",
    "tacdata.chain.table_kernels": "fem",
    "tacdata.surfaces.crossings": "fem",
    "tacdata.surfaces.nearest": "fem",
    "tacdata.surfaces.distance_grid": "fem",
    "tacdata.grasping.pin_presses": "fem",
    "tacdata.dataset.windows": "fem",
    "tacdata.pipeline.evaluate": "learn",
    "tacdata.pipeline.skin_press": "fem",
    "tacdata.pipeline.train": "learn",
    "tacdata.pipeline.trained_network": "learn",
    "tacdata.training": "learn",
    "tacdata.viewers.browse.catalogue": "view",
    "tacdata.studio.server": "view",
    "tacdata.studio.wizard.server": "view",
    "tacdata.viewers.browse.loopback": "view",
    "tacdata.viewers.browse.server": "view",
    "tacdata.viewers.rerun": "view",
    "tacdata.label_farm.service": "farm",
}
"""Rooms, and files of light rooms, that need an extra to be imported. Everything else needs the plain install."""

LIGHT = """
import importlib, json, pkgutil, sys
refused = set(json.loads(sys.argv[1]))

from importlib.machinery import PathFinder

class Installed:
    find_distributions = staticmethod(PathFinder.find_distributions)

    def find_spec(self, name, path=None, target=None):
        return None if name.split(".")[0] in refused else PathFinder.find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Installed()
"""
"""An import hook that does not find what a plain install does not bring."""
WALK = """
from tacdata.extras import missing_package
found = {}
for package in json.loads(sys.argv[2]):
    room = importlib.import_module(package)
    for module in pkgutil.walk_packages(room.__path__, package + ".", onerror=lambda name: None):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            lacking = missing_package(error, module.name)
            found[module.name] = lacking.remedy if lacking else str(error)
print(json.dumps(found))
"""
FIRST_LOOK = """
from tacdata import cli, extras
for line in json.loads(sys.argv[2]):
    sys.argv = ["tacdata", *line]
    try:
        cli.main()
    except SystemExit as end:
        assert not end.code, (line, end.code)
print("loaded:", *sorted({name.split(".")[0] for name in sys.modules}))
"""


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def light_distributions():
    """Return what `pip install tacdata` brings: its requirements without extras, and theirs."""
    found, waiting = set(), [("tacdata", "")]
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in found:
            continue
        found.add((name, extra))
        for line in distribution(name).requires or ():
            wanted = Requirement(line)
            if wanted.marker is None or wanted.marker.evaluate({"extra": extra}):
                waiting += [(canonical(wanted.name), also) for also in ("", *wanted.extras)]
    return {name for name, _ in found}


@pytest.fixture(scope="module")
def beyond():
    """Top-level modules that a plain install does not bring, as JSON."""
    kept = light_distributions()
    owners = packages_distributions().items()
    return json.dumps([module for module, names in owners if not {canonical(name) for name in names} & kept])


def run(code, *arguments, **options):
    done = subprocess.run([sys.executable, "-c", LIGHT + code, *arguments], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def test_the_plain_install_brings_nothing_heavy(beyond):
    assert set(json.loads(beyond)) >= HEAVY
    assert not {"numpy", "matplotlib", "mcap", "pyarrow", "scipy"} & set(json.loads(beyond))


def test_every_light_room_can_be_imported_without_the_extras(beyond):
    failed = json.loads(run(WALK, beyond, json.dumps(OWN)))
    assert failed, "the hook refuses nothing"
    for module, remedy in failed.items():
        rooms = [room for room in ROOMS if f"{module}.".startswith(f"{room}.")]
        assert rooms, f"{module} needs more than the plain install: {remedy}"
        assert f"'.[{ROOMS[rooms[0]]}]'" in remedy, f"{module}: {remedy}"


@pytest.mark.long("tacdata/commands", "tacdata/example", "viewers", reason="eight verbs one after the other")
def test_a_first_look_works_without_the_extras(beyond, tmp_path):
    lines = [
        ["--help"],
        ["list"],
        ["list", "indenters"],
        ["plan", "--presses", "3", "--out", "plan.yaml", "--picture", "plan.png"],
        ["example", "first"],
        ["check", "first"],
        ["browse", "first"],
        ["view", "first", "--episode", "0", "--picture", "page.png"],
    ]
    shown = run(FIRST_LOOK, beyond, json.dumps(lines), cwd=tmp_path)
    assert not HEAVY & set(shown.splitlines()[-1].split())
    for picture in ("plan.png", "first/check.png", "first/press.png", "page.png"):
        assert (tmp_path / picture).stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "module", "extra"),
    [
        (["solve", "case.json"], "torch", "fem"),
        (["discrepancy", "first", "--out", "verdict"], "warp", "fem"),
        (["train", "dataset", "--out", "run"], "torch", "learn"),
        (["view", "first", "--save", "x.rrd"], "rerun", "view"),
        (["browse", "first", "--web"], "fastapi", "view"),
        (["studio", "."], "fastapi", "view"),
        (["farm", "up"], "uvicorn", "farm"),
        (["calibrate-camera", "--board", "board.yaml", "--draw", "board.pdf"], "cv2", "camera"),
    ],
)
def test_a_verb_says_the_install_line_of_what_it_lacks(arguments, module, extra, beyond, tmp_path):
    code = "from tacdata.cli import main\nsys.argv = ['tacdata', *json.loads(sys.argv[2])]\nmain()"
    copy_session(tmp_path / "first")
    (tmp_path / "case.json").write_text("{}")
    command = [sys.executable, "-c", LIGHT + code, beyond, json.dumps(arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == Exit.PACKAGE, done.stderr
    assert f"pip install '.[{extra}]' in the clone" in done.stderr
    assert IMPORTED_AS.get(module, module) in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "verdict").exists()
    row = re.search(rf"^\| `{extra}` \|.*", (ROOT / "README.md").read_text(), re.M)
    assert arguments[0] not in ("browse", "studio") or f"`{arguments[0]}" in row[0], "README names it with its extra"


@pytest.mark.parametrize(
    ("origin", "line"),
    [
        ({"url": "file:///home/a/tacdata", "dir_info": {"editable": True}}, "pip install '.[farm]' in the clone"),
        ({"url": "file:///a/tacdata.whl", "archive_info": {}}, "pip install 'tacdata[farm] @ file:///a/tacdata.whl'"),
        ({"url": "https://a/t.git", "vcs_info": {"vcs": "git"}}, "pip install 'tacdata[farm] @ git+https://a/t.git'"),
        (None, "pip install 'tacdata[farm]'"),
    ],
)
def test_an_extra_is_installed_from_where_this_install_came(monkeypatch, origin, line):
    class Installed:
        def read_text(self, name):
            assert name == "direct_url.json"
            return json.dumps(origin) if origin else None

    monkeypatch.setattr(extras, "distribution", lambda _: Installed())
    assert extras.install_line("farm") == line


def test_a_missing_package_is_one_error_in_the_process_too(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)

    def verb():
        import rerun  # noqa: F401

    with pytest.raises(PackageError) as caught:
        cli.answering("tacdata verb", verb)()
    assert caught.value.given == "tacdata verb needs Rerun (rerun-sdk), which is not installed"
    assert caught.value.exit_code == Exit.PACKAGE


def test_a_package_of_nobodys_is_left_as_it_is():
    error = ModuleNotFoundError("No module named 'no_such_package'", name="no_such_package")
    assert missing_package(error, "a verb") is None

    def verb():
        raise error

    with pytest.raises(ModuleNotFoundError):
        cli.answering("tacdata verb", verb)()


def test_who_asks_decides_where_two_extras_bring_a_package():
    def asked_in(room):
        try:
            exec("raise ModuleNotFoundError('torch', name='torch')", {"__name__": room})
        except ModuleNotFoundError as error:
            return missing_package(error, "x")

    assert extras_of("torch") == ("fem", "learn")
    assert "'.[fem]'" in asked_in("tacdata.skin.model").remedy
    assert "'.[learn]'" in asked_in("tacdata.training.train").remedy


def test_every_package_of_an_extra_is_known_by_the_name_it_is_imported_by():
    """What is imported by another name stands in `IMPORTED_AS`; else its absence would be a traceback."""
    optional = {canonical(Requirement(line).name) for line in requires("tacdata") if "extra ==" in line}
    plain = {canonical(Requirement(line).name) for line in requires("tacdata") if "extra ==" not in line}
    assert {"warp-lang", "rerun-sdk", "torch"} <= optional
    imported, owners = {}, packages_distributions()
    for path in (path for room in OWN for path in (ROOT / room).rglob("*.py")):
        for module in re.findall(r"^\s*(?:import|from) (\w+)", path.read_text(), re.M):
            for owner in owners.get(module, ()):
                imported[canonical(owner)] = module
    unknown = {name: imported[name] for name in (optional - plain) & imported.keys()}
    for name, module in unknown.items():
        assert canonical(IMPORTED_AS.get(module, module)) == name


def test_all_is_everything():
    everything = {Requirement(line).name for line in requires("tacdata") if f"extra == '{ALL}'" in line}
    others = {Requirement(line).name for line in requires("tacdata") if "extra ==" in line}
    assert everything == others


def test_help_names_no_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert CliRunner().invoke(cli.application(), ["view", "--help"]).exit_code == Exit.DONE
