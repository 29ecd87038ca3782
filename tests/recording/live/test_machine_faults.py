"""What a controller, its line or another hand does wrong in mid-press: hold, lift, file closed, words; or no move."""

import json
import re
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from recording_examples import SENSOR, plan, recorder

from tacdata.errors import DeviceError, UsageError
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.recorder import Recorder
from tacdata.rig import read_rig

CLEARANCE = 3.0


def place(virtual):
    """Where the indenter is: x, y, and its height above the skin's nominal face [mm]."""
    at = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000)
    return at - [0.0, 0.0, read_rig(virtual.path).registration.origin[2]]


def left_state(virtual):
    """The latest record of where the machine was left; the rig's first one and the recorder's differ in name."""
    records = [json.loads(path.read_text()) for path in (virtual.directory / "machine_state").glob("*.json")]
    return max(records, key=lambda record: record["number"])


def on_the_skin(virtual, act):
    def wait():
        while place(virtual)[2] > -0.2:
            time.sleep(0.002)
        act()

    threading.Thread(target=wait, daemon=True).start()


def once(pattern, change):
    """What the wire does to the first line that matches."""
    left = [1]

    def wire(line):
        if left and re.search(pattern, line):
            left.pop()
            return change(line)
        return line

    return wire


class Deepest:
    """Follows the indenter; `height` is the lowest so far [mm], `sideways` how far it went from where it began."""

    def __init__(self, virtual):
        self.virtual, self.height, self.sideways = virtual, np.inf, 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def _follow(self):
        begin = place(self.virtual)
        while not self._stop.wait(0.001):
            at = place(self.virtual)
            self.height = min(self.height, at[2])
            self.sideways = max(self.sideways, float(np.linalg.norm(at[:2] - begin[:2])))

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._stop.set()
        self._thread.join()


def broken_off(out):
    """Return the notes of the recording that was broken off."""
    (broken,) = file_names.unfinished(out)
    return read_recording(broken).episode.notes


def test_an_answer_lost_in_mid_press_ends_in_a_lift_and_words(virtual, tmp_path):
    out = tmp_path / "session"
    lost = once("^ok$", lambda text: None)
    on_the_skin(virtual, lambda: virtual.controller.inject_wire(to_host=lost))
    begun = time.monotonic()
    with pytest.raises(DeviceError, match="stands idle and still owes an answer") as raised:
        recorder(virtual, out).run(lambda summary: True)
    assert time.monotonic() - begun < 30
    assert place(virtual)[2] == pytest.approx(CLEARANCE, abs=0.01)
    assert any("lifted off the skin" in note for note in broken_off(out))
    last = "\n".join(raised.value.__notes__)
    assert re.search(r"motion: stopped at .*\n  tip:    the indenter was lifted off the skin, straight up", last)
    assert re.search(r"data:   0 of 2 presses are complete .*\n  data:   broken off, readable: episode-000000", last)
    assert last.endswith("then:   the same command with --resume")
    assert recorder(virtual, out, resume=True).run(lambda summary: True).remaining == ()


def test_a_pendant_that_takes_over_leaves_the_tip_and_says_so(virtual, tmp_path):
    out = tmp_path / "session"
    on_the_skin(virtual, virtual.controller.inject_pendant)
    with pytest.raises(DeviceError, match="pendant has taken control") as raised:
        recorder(virtual, out).run(lambda summary: True)
    last = "\n".join(raised.value.__notes__)
    assert "motion: stopped (a pendant has control of the machine, which stands at" in last
    assert "tip:    the indenter was not lifted; leave it, the next start lifts it straight up" in last
    assert any("not lifted" in note for note in broken_off(out))


DAMAGED = [
    ("F60.000", lambda line: re.sub(r"Z-(\d)(\d)", lambda m: f"Z-{int(m[1]) + 1}{m[2]}", line), "deeper"),
    ("F60.000", lambda line: re.sub(r"Y-(\d)(\d)", lambda m: f"Y-{int(m[1]) + 1}{m[2]}", line), "sideways"),
    ("F60.000", lambda line: line.replace("F60", "F860"), "too fast"),
]


@pytest.mark.parametrize(("which", "change", "kind"), DAMAGED, ids=[kind for *_, kind in DAMAGED])
def test_a_line_that_arrives_changed_is_noticed_at_the_next_report(virtual, tmp_path, which, change, kind):
    out = tmp_path / "session"
    virtual.controller.inject_wire(to_controller=once(which, change))
    with Deepest(virtual) as followed, pytest.raises(DeviceError, match="the guide reports") as raised:
        recorder(virtual, out).run(lambda summary: True)
    assert ("than its speed allows" if kind == "too fast" else "mm off its way") in raised.value.given
    # 1 mm/s, a report each 125 ms of the clock; what a busy host adds is ten times as long for the rig.
    assert followed.height > -0.8 - 1.5
    assert place(virtual)[2] == pytest.approx(CLEARANCE, abs=0.01)
    assert any("lifted off the skin" in note for note in broken_off(out))
    assert recorder(virtual, out, resume=True).run(lambda summary: True).remaining == ()


def test_a_release_that_ends_elsewhere_is_noticed(virtual, tmp_path):
    def upward(line):
        return re.sub(r"Z-(\d)(\d)", lambda m: f"Z-{int(m[1]) - 1}{m[2]}", line)

    lines = []

    def wire(line):
        if "F60.000" in line:
            lines.append(line)
            return upward(line) if len(lines) == 2 else line
        return line

    virtual.controller.inject_wire(to_controller=wire)
    with pytest.raises(DeviceError, match="mm off its way"):
        recorder(virtual, tmp_path / "session").run(lambda summary: True)
    assert place(virtual)[2] > CLEARANCE - 0.01


def unlock(virtual):
    """What a person does in a terminal after a hard limit: reset, $X."""
    virtual.controller.machine.reset(virtual.clock.now_ns())
    virtual.controller.machine.alarm = None


def test_a_lost_position_is_remembered_until_a_person_says_that_it_was_found(virtual, tmp_path):
    out = tmp_path / "session"
    on_the_skin(virtual, virtual.controller.inject_alarm)
    with pytest.raises(DeviceError, match="hard limit") as raised:
        recorder(virtual, out).run(lambda summary: True)
    assert "hard limit" in left_state(virtual)["lost"]["why"]
    last = "\n".join(raised.value.__notes__)
    assert "the indenter was not lifted" in last
    assert "zero:   LOST" in last
    assert "find its zero again (home it, or touch off), then the same command with --resume" in last
    unlock(virtual)
    asked = []
    for _ in range(2):
        with Deepest(virtual) as followed, pytest.raises(DeviceError, match="position is not known"):
            recorder(virtual, out, resume=True, ask=lambda question: asked.append(question)).run(lambda summary: True)
        assert followed.sideways == 0.0
        assert followed.height == place(virtual)[2], "nothing moved"
    assert "straight up free" in asked[0]
    session = recorder(virtual, out, resume=True, ask=lambda question: True).run(lambda summary: True)
    assert session.remaining == ()
    assert "lost" not in left_state(virtual)


def test_a_power_cycle_in_mid_press_is_no_ground_to_stand_on(virtual, tmp_path):
    out = tmp_path / "session"
    virtual.controller.settings.update({"$22": "0", "$20": "0"})
    on_the_skin(virtual, virtual.controller.inject_brown_out)
    with pytest.raises(DeviceError, match="position is lost"):
        recorder(virtual, out, ask=lambda question: True).run(lambda summary: True)
    assert np.allclose(virtual.controller.machine.error, virtual.controller.position_at(virtual.clock.now_ns()))
    with Deepest(virtual) as followed, pytest.raises(DeviceError, match="position is not known"):
        recorder(virtual, out, resume=True).run(lambda summary: True)
    assert followed.sideways == 0.0
    assert "--yes does not" in str(_refusal(virtual, out))


def _refusal(virtual, out):
    with pytest.raises(DeviceError) as raised:
        recorder(virtual, out, resume=True).run(lambda summary: True)
    return raised.value


def test_a_machine_at_its_power_on_zero_is_not_believed_on_resuming(virtual, tmp_path):
    out = tmp_path / "session"
    with pytest.raises(RuntimeError):
        recorder(virtual, out, progress=lambda *_: (_ for _ in ()).throw(RuntimeError)).run(lambda summary: True)
    virtual.controller.settings.update({"$22": "0", "$20": "0"})
    virtual.controller.machine.brown_out(virtual.clock.now_ns())
    # Its welcome goes out while nobody listens: one that is still under way would tell of the reset.
    while virtual.controller._out:
        time.sleep(0.01)
    with pytest.raises(DeviceError, match=r"reports exactly \(0, 0, 0\), as when it is switched on"):
        recorder(virtual, out, resume=True).run(lambda summary: True)


def frozen():
    kept = []

    def change(readings):
        kept.append(readings)
        return kept[0]

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (frozen, "no channel has changed for .* the board repeats one frame"),
        (lambda: lambda readings: np.full(24, 65535.0), "all 24 channels have read 65535 counts, their limit"),
        (lambda: lambda readings: np.zeros(24), "all 24 channels have read 0 counts, their limit"),
    ],
    ids=["frozen", "saturated", "dead"],
)
def test_readings_that_cannot_be_stop_the_press_within_two_seconds(virtual, tmp_path, change, words):
    out = tmp_path / "session"
    begun = []

    def break_board():
        virtual.board.inject_readings(change())
        begun.append(virtual.clock.now_ns())

    long = plan(2, hold=20.0)
    on_the_skin(virtual, break_board)
    with pytest.raises(DeviceError, match=words):
        recorder(virtual, out, plan=long).run(lambda summary: True)
    assert place(virtual)[2] == pytest.approx(CLEARANCE, abs=0.01)
    counts = read_recording(file_names.unfinished(out)[0]).episode.taxels
    after = (counts.arrival_ns[-1] - begun[0]) * 1e-9
    assert after < 20.0, "long before the hold would have ended: the rest is this machine's load, ten times for the rig"


@pytest.mark.parametrize(
    ("flow", "words"),
    [
        (lambda data: data[:2] + bytes(len(data[2:])), "no good frame for 5 s, but .* damaged ones"),
        (None, "its counter stands still; .* frames came with a number already seen"),
    ],
    ids=["damaged", "standing counter"],
)
def test_a_board_that_sends_nothing_of_use_is_not_said_to_be_silent(virtual, tmp_path, flow, words):
    def break_board():
        encode, kept = virtual.board._encoder.encode, []

        def change(*frame):
            kept.append(encode(*frame))
            return flow(kept[-1]) if flow else kept[0]

        virtual.board._encoder.encode = change

    on_the_skin(virtual, break_board)
    with pytest.raises(DeviceError, match=words):
        recorder(virtual, tmp_path / "session", plan=plan(2, hold=60.0)).run(lambda summary: True)
    assert place(virtual)[2] == pytest.approx(CLEARANCE, abs=0.01)


def test_one_port_named_twice_is_said_to_be_that(virtual, tmp_path):
    rig = read_rig(virtual.path)
    (tmp_path / "link").symlink_to(rig.cnc["port"])
    twice = replace(rig, board={**rig.board, "port": str(tmp_path / "link")})
    with pytest.raises(UsageError, match=r"both on port .* which are one"):
        Recorder(twice, SENSOR, plan(2), tmp_path / "session")
