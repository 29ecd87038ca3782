"""The verbs as a lab types them; what moves the rig in a process of its own."""

import os
import signal
import subprocess
import sys
import time

import pytest
import yaml
from recording_examples import plan_document
from running import in_process

from tacdata.recording import read_session
from tacdata.recording.files import file_names
from tacdata.virtual_rig.rig import running

TACDATA = [sys.executable, "-m", "tacdata.cli"]


def tacdata(*arguments, **options):
    return subprocess.run([*TACDATA, *map(str, arguments)], capture_output=True, text=True, check=False, **options)


@pytest.fixture
def bench(tmp_path, speed):
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan_document(2, hold=0.3, rest=0.4)))
    with running(tmp_path / "rig", speed=speed, seed=1, camera=False) as rig:
        yield ["record", "--rig", rig, "--plan", tmp_path / "plan.yaml", "--out", tmp_path / "session"]


def test_record_asks_records_and_refuses_to_overwrite(bench, tmp_path):
    result = in_process.tacdata(*bench, answer="")
    assert result.returncode == 2
    assert "not confirmed" in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "session").exists()
    result = tacdata(*bench, input="y\n")
    assert result.returncode == 0, result.stderr
    assert "2 of 2 presses recorded" in result.stdout
    result = in_process.tacdata(*bench, "--yes")
    assert result.returncode == 2
    assert "--resume" in result.stderr
    result = in_process.tacdata(*bench, "--yes", "--resume")
    assert result.returncode == 0
    assert len(read_session(tmp_path / "session").episodes) == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_and_the_session_can_be_resumed(bench, tmp_path, number):
    child = subprocess.Popen([*TACDATA, *map(str, bench), "--yes"], stderr=subprocess.PIPE, text=True)
    second = file_names.partial(file_names.episode(tmp_path / "session", 1))
    while not second.exists() and child.poll() is None:  # a run that stands still ends itself
        time.sleep(0.01)
    os.kill(child.pid, number)
    words = child.communicate(timeout=60)[1]
    assert child.returncode == 130, words
    assert "interrupted" in words
    assert "Traceback" not in words
    assert len(file_names.finished(tmp_path / "session")) == 1
    result = tacdata(*bench, "--yes", "--resume")
    assert result.returncode == 0, result.stderr
    assert "2 of 2" in result.stdout


def test_recover_and_its_refusals_are_words(tmp_path):
    foreign = tmp_path / "x.mcap"
    foreign.write_bytes(b"x" * 100)
    result = in_process.tacdata("recover", foreign)
    assert result.returncode == 1
    assert "no MCAP file" in result.stderr
    assert "next:" in result.stderr
    assert list(tmp_path.iterdir()) == [foreign]


def test_a_missing_port_is_said_in_words(bench, tmp_path):
    rig = yaml.safe_load(bench[2].read_text())
    rig["cnc"]["port"] = "/dev/tty-not-there"
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    result = in_process.tacdata("record", "--rig", tmp_path / "rig.yaml", *bench[3:], "--yes")
    assert result.returncode == 4
    assert "/dev/tty-not-there" in result.stderr
    assert not (tmp_path / "session").exists()
