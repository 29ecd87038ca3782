"""The wheel carries everything that the code reads at run time."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("tacdata", "schemas", "label_farm", "training", "viewers")


@pytest.fixture(scope="module")
def contents(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return {n: archive.read(n) for n in archive.namelist()}


def test_the_wheel_carries_every_source_schema_and_description(contents):
    kinds = (".py", ".json", ".proto", ".yaml", ".yml", ".npz", ".html", ".j2", ".css", ".js", ".mcap", ".parquet")
    wanted = {
        ("" if package == "tacdata" else "tacdata/") + p.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for p in (ROOT / package).rglob("*")
        if p.suffix in kinds and "__pycache__" not in p.parts
    }
    assert {"tacdata/schemas/sensor.schema.json", "tacdata/sensor/tacprint.yaml", "tacdata/viewers/source.py"} <= wanted
    assert not wanted - set(contents)


def test_the_wheel_carries_nothing_else(contents):
    assert {n.split("/")[0] for n in contents if ".dist-info/" not in n} == {"tacdata"}


def test_the_wheel_says_its_commit(contents):
    """Where it is installed there is no clone to ask, and every label names the code that made it."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()
    assert contents["tacdata/commit.txt"].decode().startswith(commit)


def test_the_wheel_gives_the_command(contents):
    (entry_points,) = (text.decode() for n, text in contents.items() if n.endswith("entry_points.txt"))
    assert "tacdata = tacdata.cli:main" in entry_points
