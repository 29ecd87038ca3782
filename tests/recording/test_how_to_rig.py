"""The commands of the pages on foreign data, boards, sensors and firmware run as they stand."""

import os
import shlex
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
import yaml
from running.in_process import tacdata
from running.typed_pages import HOW_TO, blocks, commands

from tacdata.recording.session import read_session

ROOT = HOW_TO.parents[1]
sys.path.append(str(ROOT / "tests" / "importing"))
PLAN = """\
version: "1.2"
name: two-presses
indenters: {sphere_2: {shape: sphere, radius: 2.0}}
motion: {clearance: 4.0, standoff: 0.3, travel_speed: 20.0, approach_speed: 5.0, press_speed: 0.7, hold: 0.7, rest: 1.0}
presses:
- {indenter: sphere_2, x: 0.0, y: 0.0, yaw: 0.0, depth: 0.4}
- {indenter: sphere_2, x: 1.9, y: 1.25, yaw: 0.0, depth: 0.5}
"""


def typed(folder, words, *more, answer=""):
    """Type a command of a page; return what it said."""
    done = tacdata(*words, *more, folder=folder, answer=answer)
    assert done.returncode == 0, f"tacdata {shlex.join(words)}: {done.stdout}{done.stderr}"
    return done.stdout


@contextmanager
def emulated(folder, words):
    """`tacdata virtual-rig rig ...` as typed, in a process of its own, until the block ends."""
    rig = subprocess.Popen([sys.executable, "-m", "tacdata.cli", *words], cwd=folder, stdout=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 120
        while not (folder / "rig" / "rig.yaml").is_file() and time.monotonic() < end:
            time.sleep(0.2)
        yield
    finally:
        rig.terminate()
        rig.wait(60)


def test_foreign_recordings_come_in_by_the_page(tmp_path):
    from foreign import press_data

    (tmp_path / "measured").mkdir()
    for number in range(3):
        rows = np.column_stack(press_data(number))
        names = ",".join(["t", "depth", "Fz", *(f"cap{k}" for k in range(rows.shape[1] - 3))])
        np.savetxt(tmp_path / "measured" / f"run_{number}.csv", rows, "%.5f", ",", header=names, comments="")
    _, propose, bring, look = commands(HOW_TO / "foreign_data.md")  # the first one is the wizard on a page
    typed(tmp_path, propose)
    proposed = yaml.safe_load((tmp_path / "mapping.yaml").read_text())
    assert proposed["position"]["depth"]["column"].startswith("depth"), "the guess that the page speaks of"
    mapping, _ = blocks(HOW_TO / "foreign_data.md", "yaml")  # the second holds the keys that labels need
    (tmp_path / "mapping.yaml").write_text(mapping)
    typed(tmp_path, bring)
    assert "3 recordings" in typed(tmp_path, look)


def test_a_board_of_ones_own_records_by_the_page(tmp_path):
    """The page's copy of the frame format, beside a rig whose board sends so."""
    record, look = commands(HOW_TO / "own_board.md")
    with emulated(tmp_path, ["virtual-rig", "rig", "--no-camera"]):
        shutil.copy(ROOT / "tacdata" / "wire" / "cap24.yaml", tmp_path / "my.yaml")
        rig = yaml.safe_load((tmp_path / "rig" / "rig.yaml").read_text())
        rig["board"]["format"] = str(tmp_path / "my.yaml")
        (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
        (tmp_path / "plan.yaml").write_text(PLAN)
        words = ["live.rrd" if word == "window" else word for word in record]
        assert "2 of 2 presses recorded" in typed(tmp_path, words, answer="y\n")
    assert (tmp_path / "live.rrd").stat().st_size > 5_000
    assert "session: 2 recordings" in typed(tmp_path, look)


@pytest.mark.long("tacdata/commands", "docs/how_to/own_sensor.md", reason="a rig, and a verdict")
@pytest.mark.timeout(3600)
def test_a_sensor_of_ones_own_by_the_page(tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    plan, rig, record, judge = commands(HOW_TO / "own_sensor.md")
    typed(tmp_path, plan)
    with emulated(tmp_path, rig):
        assert "8 of 8 presses recorded" in typed(tmp_path, record, answer="y\n")
        refused = tacdata(
            *[w for w in record if w not in ("--sensor", "examples/own_sensor.yaml")][:-1],
            "other",
            folder=tmp_path,
            answer="y\n",
        )
    assert refused.returncode == 2 and "the board sends 16 channels" in refused.stderr
    assert not (tmp_path / "other").exists(), "nothing moved, nothing was written"
    assert len(read_session(tmp_path / "session").done) == 8
    typed(tmp_path, judge)
    assert (tmp_path / "verdict" / "verdict.html").is_file()


def test_the_firmware_page_starts_tests_that_are_there():
    """The firmware itself is not at hand: the command collects, and each test says what it lacks."""
    line, port = blocks(HOW_TO / "testing_with_firmware.md", "sh")
    path = os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]])
    done = subprocess.run(
        ["sh", "-c", f"{line.strip()} --collect-only -q"],
        cwd=ROOT,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tests/recording/test_grbl_firmware.py" in done.stdout
    assert shlex.split(port)[0] == "socat"
