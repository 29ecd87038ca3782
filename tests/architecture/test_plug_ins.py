"""Members that do not ship: from a folder that a file names, and from an installed distribution."""

import importlib
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

import tacdata as td
from tacdata import catalogue, registry
from tacdata.clock import Clock
from tacdata.devices.device import TaxelBoard, create
from tacdata.errors import FormatError, UsageError
from tacdata.rig.rig import read_rig
from tacdata.sensor import default_sensor
from tacdata.skin.code_version import code_versions

ROOT = Path(__file__).resolve().parents[2]
BOARD = '''
"""A board on an I2C bus."""

from tacdata.devices.device import StreamCounts, TaxelBoard


class I2cBoard(TaxelBoard):
    """Reads a bus by its number."""

    def __init__(self, clock, bus: int, address: int = 0x40):
        super().__init__(clock)
        self.bus, self.counts = bus, StreamCounts()

    def describe(self):
        return {"kind": "taxel board", "driver": "i2c_board", "bus": self.bus}

    def open(self):
        pass

    def close(self):
        pass

    def read(self, timeout):
        return []
'''
WEDGE = '''
"""A ball under another name."""

from dataclasses import dataclass

from tacdata.indenters.sphere import Sphere


@dataclass(frozen=True)
class LabBall(Sphere):
    """A ball of the lab."""
'''
RIG = {
    "version": "1.3",
    "name": "bench",
    "plugins": "lab",
    "cnc": {"driver": "grbl", "port": "/dev/ttyUSB0"},
    "board": {"driver": "i2c_board", "bus": 1},
    "registration": {"origin": [0.0, 0.0, 0.0], "yaw": 0.0},
    "envelope": {"min": [-20.0, -20.0, -10.0], "max": [20.0, 20.0, 20.0]},
}


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """Return a folder of plug-ins that no test after this one knows."""
    monkeypatch.setenv(registry.VARIABLE, "")
    for room in ("tacdata.devices", "tacdata.indenters"):
        package = importlib.import_module(room)
        monkeypatch.setattr(package, "__path__", [*package.__path__])
    folder = tmp_path / "lab"
    for room, name, text in (("devices", "i2c_board", BOARD), ("indenters", "lab_ball", WEDGE)):
        (folder / room).mkdir(parents=True)
        (folder / room / f"{name}.py").write_text(text)
    yield folder
    for name in ("tacdata.devices.i2c_board", "tacdata.indenters.lab_ball"):
        sys.modules.pop(name, None)


def rig_file(lab, **change):
    """Write a rig file beside a folder of plug-ins."""
    path = lab.parent / "rig.yaml"
    path.write_text(yaml.safe_dump({**RIG, **change}))
    return path


def test_a_rig_file_names_a_driver_of_its_own_that_has_no_serial_port(lab):
    rig = read_rig(rig_file(lab))
    board = create(rig.board, TaxelBoard, Clock.start())
    assert board.describe() == {"kind": "taxel board", "driver": "i2c_board", "bus": 1}
    assert "i2c_board" in registry.names("tacdata.devices", "device")
    listed = {member.name: member.meaning for member in catalogue.members("devices")}
    assert listed["i2c_board"] == "A board on an I2C bus."


@pytest.mark.parametrize(
    ("board", "words"),
    [
        ({"driver": "i2c_board"}, "without bus"),
        ({"driver": "i2c_board", "bus": 1, "port": "none"}, "setting port"),
        ({"driver": "i2c_bord", "bus": 1}, "did you mean 'i2c_board'"),
        ({"driver": "capacitive_board"}, "without port"),
    ],
)
def test_settings_that_do_not_fit_a_driver_end_in_words(lab, board, words):
    rig = read_rig(rig_file(lab, board=board))
    with pytest.raises(UsageError, match=words):
        create(rig.board, TaxelBoard, Clock.start())


def test_a_sensor_file_names_plug_ins_and_stays_the_same_sensor(lab):
    path = lab.parent / "sensor.yaml"
    path.write_text(yaml.safe_dump({**default_sensor().document, "plugins": "lab"}))
    assert td.read_sensor(path).content_hash == default_sensor().content_hash
    assert td.indenter("lab_ball", radius=3.0).document == {"shape": "lab_ball", "radius": 3.0}


def test_the_version_of_the_skin_follows_plug_ins_that_can_decide_a_press(lab):
    without = code_versions()
    td.add_plugins(lab)
    first = code_versions()
    (lab / "indenters" / "lab_ball.py").write_text(WEDGE.replace("lab", "other lab"))
    second = code_versions()
    assert "plug_ins" not in without
    assert first["plug_ins"] != second["plug_ins"]
    assert {**without, "plug_ins": first["plug_ins"]} == first


def test_a_project_names_its_plug_ins(lab):
    (lab.parent / "pyproject.toml").write_text('[tool.tacdata]\nplugins = ["lab"]\n')
    registry.add_project(lab.parent)
    assert td.indenter("lab_ball", radius=3.0).extent == 3.0
    (lab.parent / "pyproject.toml").write_text('[tool.tacdata]\nplugins = "lab"\n')
    with pytest.raises(FormatError, match="plugins = 'lab'"):
        registry.add_project(lab.parent)
    (lab.parent / "pyproject.toml").write_text("[tool.other\n")
    registry.add_project(lab.parent)


def test_folders_that_hold_no_plug_ins_are_refused(lab):
    with pytest.raises(UsageError, match="no folder of plug-ins"):
        read_rig(rig_file(lab, plugins="nowhere"))
    with pytest.raises(UsageError, match="no folder of plug-ins"):
        td.add_plugins(lab / "devices")
    (lab / "indenters").rename(lab / "indenter")
    with pytest.raises(UsageError, match="rename it to indenters"):
        td.add_plugins(lab)


def test_the_environment_names_no_folder_in_vain(lab, monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, str(lab.parent / "nowhere"))
    with pytest.raises(UsageError, match="nowhere is no folder of plug-ins"):
        td.indenter("lab_ball", radius=3.0)


def test_the_kinds_of_plug_ins_are_the_registries():
    assert set(registry.KINDS) == {each.room.rsplit(".", 1)[-1] for each in catalogue.registries().values()}


def test_a_plug_in_cannot_take_the_name_of_a_member_that_ships(lab):
    (lab / "indenters" / "sphere.py").write_text(WEDGE)
    td.add_plugins(lab)
    with pytest.raises(UsageError, match=r"tacdata ships indenters/sphere"):
        td.indenter("sphere", radius=3.0)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with a distribution of plug-ins, built and installed as a wheel."""
    place = tmp_path_factory.mktemp("distribution")
    package = place / "source" / "lab_tools"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "lab_ball.py").write_text(WEDGE)
    (package / "i2c_board.py").write_text(BOARD)
    (place / "source" / "pyproject.toml").write_text(
        """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "lab-tools"
version = "1.0"
[project.entry-points."tacdata.indenters"]
lab_ball = "lab_tools.lab_ball"
lab_cube = "lab_tools.lab_ball"
[project.entry-points."tacdata.devices"]
i2c_board = "lab_tools.i2c_board"
"""
    )
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(place)]
    subprocess.run(build, cwd=place / "source", check=True, capture_output=True)
    [wheel] = place.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(place / "site")
    return place / "site"


def python(site, text):
    """Run a program that finds the distribution; return what it prints, as JSON."""
    path = os.pathsep.join((str(site), str(ROOT)))
    environment = {**os.environ, "PYTHONPATH": path, registry.VARIABLE: ""}
    done = subprocess.run([sys.executable, "-c", text], env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_an_installed_distribution_brings_members(site):
    program = """
import json
import tacdata as td
from tacdata import catalogue, registry
from tacdata.clock import Clock
from tacdata.devices.device import TaxelBoard, create

ball = td.indenter("lab_ball", radius=2.0)
board = create({"driver": "i2c_board", "bus": 3}, TaxelBoard, Clock.start())
try:
    td.indenter("lab_cube", radius=2.0)
except td.UsageError as error:
    refused = str(error)
listed = [member.name for member in catalogue.members("indenters")]
plugged = sorted(registry.plug_ins("tacdata.indenters"))
print(json.dumps([ball.document, board.describe()["bus"], "lab_ball" in listed, plugged, refused]))
"""
    document, bus, listed, plugged, refused = python(site, program)
    assert document == {"shape": "lab_ball", "radius": 2.0}
    assert bus == 3
    assert listed
    assert plugged == ["lab_ball", "lab_cube"]
    assert "a module of the same name" in refused
