"""The verb on the virtual rig, through real drivers and pseudo-terminals."""

import os
import re
import signal
import sys
import threading
import time

import numpy as np
import pytest
import yaml

from tacdata import cli, documents
from tacdata.errors import UsageError
from tacdata.recording.files.reader import read_episode
from tacdata.registration.chosen import FILE, chosen_registration
from tacdata.rig import Registration, read_rig
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.rig import VirtualRig


def run(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["tacdata", *map(str, arguments)])
    code = 0
    try:
        cli.main()
    except SystemExit as caught:
        code = caught.code or 0
    return code, *capfd.readouterr()


@pytest.fixture
def virtual(tmp_path, speed):
    rig = VirtualRig(tmp_path / "rig", speed, seed=4, camera=False, rough=True)
    rig.start()
    yield rig
    rig.stop()


PLAN = {
    "version": "1.0",
    "name": "one",
    "indenters": {"ball": {"shape": "sphere", "radius": 2.0}},
    "motion": {
        "clearance": 3.0,
        "travel_speed": 20.0,
        "approach_speed": 5.0,
        "press_speed": 1.0,
        "hold": 0.3,
        "rest": 0.5,
    },
    "presses": [{"indenter": "ball", "x": 3.8, "y": 2.5, "depth": 0.5}],
}


def record(virtual, tmp_path, out, *more):
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    return ["record", "--rig", virtual.path, "--plan", tmp_path / "plan.yaml", "--out", out, "--yes", *more]


@pytest.mark.long("tacdata/commands", "tacdata/virtual_rig", reason="a rig recorded, registered and recorded again")
def test_register_then_record_presses_where_the_sensor_really_is(virtual, tmp_path, monkeypatch, capfd):
    truth = virtual.truth.registration
    code, said, loud = run(monkeypatch, capfd, *record(virtual, tmp_path, tmp_path / "blind"))
    assert code == 0, loud
    assert "NOT REGISTERED" in loud
    assert run(monkeypatch, capfd, "check", tmp_path / "blind")[1].count("registered") == 1

    code, said, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 0, loud
    assert "the search stops at the first answer" in said, "the summary comes before the first move"
    document = documents.read(virtual.path.with_name(FILE), "registration")
    got = Registration.from_document(document)
    assert np.abs(np.subtract(got.origin[:2], truth.origin[:2])).max() < 0.1
    assert abs(got.origin[2] - truth.origin[2]) < 0.02
    for x, y in ((-4.75, -3.75), (4.75, 3.75)):
        error = np.subtract(got.to_machine(x, y, 0.0), truth.to_machine(x, y, 0.0))
        assert np.abs(error[:2]).max() < 0.1
        assert abs(error[2]) < 0.02
    assert document["guess"]["yaw"] == 1.2

    code, said, loud = run(monkeypatch, capfd, *record(virtual, tmp_path, tmp_path / "seen"))
    assert code == 0, loud
    assert "NOT REGISTERED" not in loud
    assert (tmp_path / "seen" / FILE).is_file()
    episode = read_episode(tmp_path / "seen" / "episode-000000.mcap")
    assert episode.rig["registration"]["tilt"] == document["tilt"]
    hold = next(phase for phase in episode.phases if phase.name == "hold")
    reported = episode.cnc.position[(episode.cnc.sample_ns > hold.start_ns) & (episode.cnc.sample_ns < hold.end_ns)]
    real = truth.to_sensor(reported[:1])[0]
    assert real == pytest.approx([3.8, 2.5, 0.5], abs=0.1)
    assert real[2] == pytest.approx(0.5, abs=0.02)

    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 2
    assert "exists" in loud


def test_a_skin_that_is_not_there_stops_the_search_at_the_limit(virtual, tmp_path, monkeypatch, capfd):
    document = yaml.safe_load(virtual.path.read_text())
    document["registration"]["origin"][2] += 3.0
    high = tmp_path / "high.yaml"
    high.write_text(yaml.safe_dump(document))
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", high, "--yes", "--limit", "0.6")
    assert code == 4
    assert "no channel answered" in loud
    assert "Traceback" not in loud
    assert not (tmp_path / FILE).exists()
    height = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000)[2]
    assert height > document["registration"]["origin"][2] + 1.0, "risen clear of the skin"


def test_nothing_moves_without_a_yes(virtual, monkeypatch, capfd):
    before = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000).copy()
    monkeypatch.setattr("builtins.input", lambda question: "n")
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path)
    assert code == 2
    assert "not confirmed" in loud
    after = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000)
    assert np.array_equal(before, after)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--indenter", "punch"], "sphere"),
        (["--indenter", "hammer"], "hammer"),
        (["--taxel", "3"], "two or more"),
        (["--taxel", "3", "--taxel", "99"], "99"),
        (["--limit", "2.5"], "1.65"),
    ],
)
def test_wrong_wishes_end_in_words_before_any_port_is_opened(arguments, word, tmp_path, monkeypatch, capfd):
    rig = {
        "version": "1.0",
        "name": "none",
        "cnc": {"driver": "grbl", "port": "/nowhere"},
        "board": {"driver": "capacitive_board", "port": "/nowhere"},
        "registration": {"origin": [0, 0, 0], "yaw": 0},
        "envelope": {"min": [-9, -9, -9], "max": [9, 9, 9]},
    }
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", tmp_path / "rig.yaml", "--yes", *arguments)
    assert code == 2
    assert word in loud


def test_a_registration_of_another_sensor_is_refused(virtual, tmp_path):
    rig, sensor = read_rig(virtual.path), default_sensor()
    document = registration_of(rig, sensor)
    path = tmp_path / FILE
    documents.write(path, document, "registration")
    chosen = chosen_registration(rig, virtual.path, path, sensor)
    assert chosen.rig.registration.tilt == (0.01, -0.005)
    assert chosen.rig.document["registration"]["residual"] == pytest.approx(0.012)
    assert any("homing" in text for text in chosen.warnings)
    documents.write(path, {**document, "sensor_hash": "0" * 64}, "registration")
    with pytest.raises(UsageError, match="another sensor"):
        chosen_registration(rig, virtual.path, path, sensor)
    documents.write(path, {**document, "rig": "another bench"}, "registration")
    with pytest.raises(UsageError, match="another rig"):
        chosen_registration(rig, virtual.path, path, sensor)


def registration_of(rig, sensor):
    return {
        "version": "1.0",
        "method": "touch-off and cross scan",
        "date": "2020-01-01T00:00:00+00:00",
        "code_version": "0",
        "rig": rig.name,
        "guess": {},
        "sensor": sensor.name,
        "sensor_hash": sensor.content_hash,
        "indenter": {"shape": "sphere", "radius": 2.0},
        "controller": {"$22": "0"},
        "settings": {},
        "origin": [1.0, 2.0, 3.0],
        "yaw": 0.0,
        "tilt": [0.01, -0.005],
        "uncertainty": {"origin": [0.01, 0.01, 0.005], "yaw": 0.1, "tilt": [0.001, 0.001]},
        "residuals": {"touches": [-0.012], "taxels": [0.004], "scale": 1.0},
        "noise": [4.0],
        "touches": [],
        "crosses": [],
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_search_and_nothing_is_written(virtual, monkeypatch, capfd, number):
    before = signal.getsignal(number)

    def place():
        return virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000).copy()

    begin = place()

    def send():
        """In the search, once it moves; without a handler the signal would end the test process."""
        deadline = time.monotonic() + 60
        while np.abs(place() - begin).max() < 1.0 and time.monotonic() < deadline:
            time.sleep(0.05)
        if signal.getsignal(number) != before:
            os.kill(os.getpid(), number)

    threading.Thread(target=send, daemon=True).start()
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 130, loud
    assert re.search(r"(?s)motion: (stopped|at rest) at .*data:   nothing was written", loud), loud
    assert not virtual.path.with_name(FILE).exists()
    assert signal.getsignal(number) == before


def test_a_second_lost_answer_ends_the_search_with_the_tip_lifted_and_words(virtual, monkeypatch, capfd):
    """After the first the search is done once more."""
    left = [30]

    def lose(text):
        left[0] -= text == "ok"
        if left[0]:
            return text
        left[0] = 30
        return None

    virtual.controller.inject_wire(to_host=lose)
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 4
    assert "stands idle and still owes an answer" in loud
    assert re.search(r"(?s)motion: stopped at .*tip:    the indenter was lifted .*data:   nothing was written", loud)
    assert "--resume" not in loud
    assert not virtual.path.with_name(FILE).exists()


def test_a_board_that_was_reset_by_opening_is_not_moved_by_yes(virtual, monkeypatch, capfd):
    virtual.controller.settings.update({"$22": "0", "$20": "0"})
    before = virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000).copy()
    monkeypatch.setattr("tacdata.devices.grbl.Grbl.position_lost", "the controller was reset when its port was opened")
    monkeypatch.setattr("builtins.input", lambda question: "n")
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 4
    assert "the position is not known" in loud
    assert "motion: nothing was moved" in loud
    assert np.array_equal(before, virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000))


def test_an_alarm_is_not_homed_away_without_a_persons_yes(virtual, monkeypatch, capfd):
    document = yaml.safe_load(virtual.path.read_text())
    document["cnc"]["home"] = True
    virtual.path.write_text(yaml.safe_dump(document))
    virtual.controller.inject_alarm(3)  # it was reset in motion: the tip may be in the skin
    while virtual.controller.machine.alarm != 3:  # or it comes while the port is opened, and is another reason
        time.sleep(0.01)
    monkeypatch.setattr("builtins.input", lambda question: "n")
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code != 0
    assert "the machine was not homed: the controller is locked" in loud, loud
    assert "motion: nothing was moved" in loud


@pytest.mark.parametrize("verb", ["register", "record"])
def test_a_ctrl_c_before_anything_is_opened_says_that_nothing_moved(verb, tmp_path, monkeypatch, capfd):
    def interrupted(path):
        raise KeyboardInterrupt

    monkeypatch.setattr("tacdata.rig.read_rig", interrupted)
    more = ["--plan", "p.yaml", "--out", tmp_path / "s"] if verb == "record" else []
    code, _, loud = run(monkeypatch, capfd, verb, "--rig", tmp_path / "rig.yaml", *more)
    assert code == 130
    assert "motion: nothing was moved\n  data:   nothing was written\n  then:   the same command" in loud


def test_after_a_power_cycle_in_mid_press_nothing_moves_before_an_answer(virtual, tmp_path, monkeypatch, capfd):
    """Without homing the controller counts from where it was switched on."""
    monkeypatch.setattr("builtins.input", lambda question: "n")
    virtual.controller.settings.update({"$20": "0", "$22": "0"})
    surface = read_rig(virtual.path).registration.origin[2]
    pressing = tmp_path / "session" / "episode-000000.partial.mcap"

    def place():
        return virtual.controller.position_at(virtual.clock.now_ns() - 5_000_000).copy()

    def cycle():
        while not pressing.exists() or place()[2] > surface - 0.2:
            time.sleep(0.002)
        virtual.controller.inject_brown_out()

    threading.Thread(target=cycle, daemon=True).start()
    code, _, loud = run(monkeypatch, capfd, *record(virtual, tmp_path, tmp_path / "session"))
    assert code == 4, loud
    assert "zero:   LOST" in loud
    before = place()
    assert before[2] < surface, "the tip is in the skin"

    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes")
    assert code == 4, loud
    assert "the position is not known: the controller was reset in mid-stream" in loud
    assert "motion: nothing was moved" in loud
    assert np.array_equal(place(), before)
    assert not virtual.path.with_name(FILE).exists()

    # The code answers this question, even untruly; the envelope, which the wrong count has left, is the last safeguard.
    [answer] = re.findall(r"--confirm-position (\w+)\)", loud)
    code, _, loud = run(monkeypatch, capfd, "register", "--rig", virtual.path, "--yes", "--confirm-position", answer)
    assert code == 4, loud
    assert "the guide stands at (0.00, 0.00, 0.00) mm, outside the envelope" in loud
    assert np.array_equal(place(), before)
