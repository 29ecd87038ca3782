"""Faults in mid-press on the emulated rig: the motion stops, what was received is on disk, the session goes on."""

import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import yaml
from recording_examples import plan_document, recorder

from tacdata import documents
from tacdata.errors import DeviceError
from tacdata.recording import read_session
from tacdata.recording.check.report import check
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.recover import recover
from tacdata.recording.session import resume_session
from tacdata.rig import read_rig

CLEARANCE = 3.0


def height(virtual):
    """Height of the indenter above the skin's nominal face [mm]."""
    at = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000)
    return at[2] - read_rig(virtual.path).registration.origin[2]


def on_the_skin(virtual, act):
    def wait():
        while height(virtual) > -0.2:
            time.sleep(0.002)
        act()

    threading.Thread(target=wait, daemon=True).start()


def test_a_pulled_cable_in_mid_press(virtual, tmp_path):
    out = tmp_path / "session"
    on_the_skin(virtual, virtual.board.port.close)
    with pytest.raises(DeviceError, match="taxel board"):
        recorder(virtual, out).run(lambda summary: True)
    assert height(virtual) == pytest.approx(CLEARANCE, abs=0.01)
    (broken,) = file_names.unfinished(out)
    recording = read_recording(broken)
    assert any("lifted" in note for note in recording.episode.notes)
    counters = recording.episode.taxels.counter
    assert len(counters) > 20
    assert (np.diff(counters) == 1).all()
    assert len(read_session(out).remaining) == 2


def test_garbage_and_half_frames_in_mid_press_cost_what_they_hit(virtual, tmp_path):
    out = tmp_path / "session"
    on_the_skin(virtual, lambda: [virtual.board.port.write(junk) for junk in (bytes(70), b"\xa5\x5a\x01", b"\xff" * 9)])
    session = recorder(virtual, out).run(lambda summary: True)
    assert session.remaining == ()
    first, second = (read_recording(path) for path in session.episodes)
    assert first.counts["taxels"]["garbage_bytes"] + 54 * first.counts["taxels"]["corrupt"] >= 70
    assert first.counts["taxels"]["lost"] <= 2
    assert second.counts["taxels"]["garbage_bytes"] == 0, "each recording counts its own"
    report = check(out)
    assert any("belong to none" in f.text or "damaged" in f.text for f in report.findings)


@pytest.mark.parametrize("virtual", [True], indirect=True)
def test_a_camera_that_stalls_in_mid_press(virtual, tmp_path):
    out = tmp_path / "session"
    on_the_skin(virtual, virtual.camera.inject_stall)
    with pytest.raises(DeviceError, match="camera"):
        for _ in range(4):  # the plan may end before the stall is noticed
            recorder(virtual, out, resume=out.exists()).run(lambda summary: True)
            (out / "session.json").unlink()
            out = out.with_name(out.name + "x")
    assert height(virtual) == pytest.approx(CLEARANCE, abs=0.01)


TACDATA = [sys.executable, "-m", "tacdata.cli"]


@pytest.fixture
def bench(virtual, tmp_path):
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan_document(2, hold=0.3, rest=0.4)))
    common = ["--rig", str(virtual.path), "--plan", str(tmp_path / "plan.yaml"), "--out", str(tmp_path / "session")]
    return [*TACDATA, "record", *common, "--yes"]


AT_ANOTHER_TIME = pytest.mark.long("tacdata/commands", "tacdata/virtual_rig", reason="a disk full at another time")


@pytest.mark.parametrize(
    "room", [pytest.param(3_000, marks=AT_ANOTHER_TIME), 12_000, pytest.param(30_000, marks=AT_ANOTHER_TIME)]
)
def test_a_full_disk_is_said_and_the_session_goes_on(bench, virtual, tmp_path, room):
    out = tmp_path / "session"
    result = subprocess.run(
        bench,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)),
    )
    assert result.returncode == 4, result.stderr
    assert "Traceback" not in result.stderr
    assert "make room" in result.stderr or "free some space" in result.stderr
    if height(virtual) < 20:
        assert height(virtual) == pytest.approx(CLEARANCE, abs=0.01), "off the skin"
    assert not list(out.glob(".session*")), "no litter"
    for path in out.glob("*.partial.mcap"):
        recovered = recover(path, tmp_path / "copy.mcap") if room > 12_000 else None
        assert recovered is None or recovered.messages > 20
    again = [*bench, "--resume"] if (out / "session.json").exists() else bench
    result = subprocess.run(again, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "2 of 2" in result.stdout


def test_kill_9_in_mid_press_loses_less_than_a_second_and_the_session_goes_on(bench, virtual, tmp_path):
    out = tmp_path / "session"
    # A long hold: a busy machine that kills late does not find the press done and no file open.
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan_document(2, hold=8.0, rest=0.4)))
    child = subprocess.Popen(bench, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    # The touch that proves the zero goes as deep, before any file is open.
    while height(virtual) > -0.2 or not list(out.glob("*.partial.mcap")):
        assert child.poll() is None, "it ended by itself"
        time.sleep(0.002)
    time.sleep(0.7)  # the first chunk is on disk half a second after the file was opened, later on a busy machine
    killed_ns = virtual.clock.now_ns()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    (partial,) = out.glob("*.partial.mcap")
    last = read_recording(partial).episode.taxels.arrival_ns[-1]
    assert (killed_ns - last) / 1e9 / virtual.clock.rate < 1.0, "seconds of real time"
    found = recover(partial, tmp_path / "copy.mcap")
    assert found.messages > 20
    time.sleep(1.0)  # the emulated machine ends its last line
    refused = subprocess.run([*bench, "--resume"], capture_output=True, text=True, check=False)
    [code] = re.findall(r"--confirm-position (\w+)\)", refused.stderr)
    assert refused.returncode != 0 and "nothing was moved" in refused.stderr
    bench = [*bench, "--resume", "--confirm-position", code]
    result = subprocess.run(bench, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "2 of 2" in result.stdout
    assert len(file_names.unfinished(out)) == 1, "what the kill left is put aside, not overwritten"


def test_a_recording_that_a_kill_left_whole_gets_its_name(virtual, tmp_path):
    out = tmp_path / "session"
    session = recorder(virtual, out).run(lambda summary: True)
    document = {**session.document, "episodes": []}
    for number, path in enumerate(session.episodes):
        partial = path.rename(file_names.partial(path))
        partial.write_bytes(partial.read_bytes()[: -5000 if number == 0 else None])
    documents.write(out / "session.json", document, "session")
    session = resume_session(out, session.plan, session.sensor, document["rig"])
    assert session.done == {1}
    assert [path.name for path in session.unfinished] == ["episode-000000.interrupted-0.mcap"]


def test_a_computer_that_stood_still_in_mid_press_lifts_and_says_so(bench, virtual, tmp_path):
    out = tmp_path / "session"
    child = subprocess.Popen(bench, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while height(virtual) > -0.2:
        assert child.poll() is None, child.stderr.read()
        time.sleep(0.002)
    os.kill(child.pid, signal.SIGSTOP)
    end = virtual.host.monotonic() + 4.0  # the rig's clock waits where this computer is busy
    while virtual.host.monotonic() < end:
        time.sleep(0.05)
    os.kill(child.pid, signal.SIGCONT)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 4, said
    assert "this computer stood still for" in said
    assert "partly lost" in said
    assert "tip:    the indenter was lifted off the skin" in said
    assert height(virtual) == pytest.approx(CLEARANCE, abs=0.01)
    again = subprocess.run([*bench, "--resume"], capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    assert len(file_names.finished(out)) == 2
