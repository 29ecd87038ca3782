"""Answers to the controller's lines that are lost, and lines that are changed on their way.

After a lost answer the sync tap and the registration are tried once more, then end in words. A changed line is stopped
at once where the controller echoes lines, else at the report that leaves the path.
"""

import json
import re

import numpy as np
import pytest
from simulated_rig import ORIGIN, World

from tacdata.devices.device import OwesAnswer
from tacdata.errors import DeviceError
from tacdata.recording.check.report import check
from tacdata.recording.files.mcap_records import read_records
from tacdata.recording.files.reader import read_recording
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.registration.guarded_probe import guarded_probe

PRESSING = "F30.000"
"""What lines of the press and of the release end with: 0.5 mm/s."""


def losing(world, times):
    """Lose every sixth answer from now on, so often."""
    left, answers = [times], [0]

    def change(data):
        if data.strip() == b"ok" and left[0]:
            answers[0] += 1
            if answers[0] % 6 == 0:
                left[0] -= 1
                return b""
        return data

    world.cnc_line.to_host.change = change


@pytest.mark.parametrize(("lost", "done"), [(1, True), (2, False)])
def test_the_sync_tap_is_tried_once_more(tmp_path, lost, done):
    world = World(5, tmp_path / "session", presses=1)
    world.schedule.extend(600.0)
    world.schedule.at(round(4e9), lambda: losing(world, lost))
    if done:
        assert len(world.record(sync_tap=True).done) == 1
    else:
        with pytest.raises(OwesAnswer, match="stands idle and still owes an answer") as error:
            world.record(sync_tap=True)
        assert "the indenter stands clear of the skin" in "".join(error.value.__notes__)
    world.end()
    assert sum("the sync tap is tried once more" in words for words in world.said) == 1
    assert world.position()[2] > ORIGIN[2]


@pytest.mark.parametrize(("lost", "done"), [(1, True), (2, False)])
def test_a_way_of_the_registration_is_tried_once_more(tmp_path, lost, done):
    world = World(6, tmp_path / "session")
    low, high = (ORIGIN[0], ORIGIN[1], ORIGIN[2] - 0.5), ORIGIN[2] + 5.0
    rig = world.rig()
    devices = RigDevices.of(rig)

    def work():
        with devices.opened(), guarded_probe(rig, devices, high, 5.0, say=world.said.append) as probe:
            probe.go(low, 2.0)
            losing(world, lost)
            for _ in range(6):
                probe.go((*low[:2], low[2] + 0.3), 2.0)
                probe.go(low, 2.0)
            return world.position()

    if done:
        assert world.computer.run(work) == pytest.approx(low, abs=0.01)
    else:
        with pytest.raises(OwesAnswer):
            world.computer.run(work)
    assert world.position()[2] == pytest.approx(high, abs=0.01)
    world.end()
    assert sum("tried once more" in words for words in world.said) == 1


def test_no_way_is_tried_again_after_a_stream_failed_in_the_lift(tmp_path):
    world = World(6, tmp_path / "session")
    low, high = (ORIGIN[0], ORIGIN[1], ORIGIN[2] - 0.5), ORIGIN[2] + 5.0
    rig = world.rig()
    devices = RigDevices.of(rig)

    def unplugging(line):
        if f"Z{high:.4f}" in line:
            world.board_line.close()
        return line

    def work():
        with devices.opened(), guarded_probe(rig, devices, high, 5.0, say=world.said.append) as probe:
            probe.go(low, 2.0)
            losing(world, 1)
            world.controller.inject_wire(to_controller=unplugging)
            for _ in range(6):
                probe.go((*low[:2], low[2] + 0.3), 2.0)
                probe.go(low, 2.0)

    with pytest.raises(DeviceError):
        world.computer.run(work)
    assert not world.board_line.plugged
    world.end()
    assert not any("tried once more" in words for words in world.said)
    assert world.position()[2] == pytest.approx(high, abs=0.01)


def deeper(line):
    """One digit is another: 10 mm deeper."""
    return re.sub(r"Z-(\d)", lambda match: f"Z-{int(match[1]) + 1}", line, count=1)


def played(folder, change, echo, firmware="Grbl"):
    """Record while the first line of a press is changed; return the world and the error."""
    world, changed = World(3, folder / "session", echo=echo, firmware=firmware), []

    def wire(line):
        if PRESSING in line and not changed:
            changed.append(world.schedule.now)
            return change(line)
        return line

    world.controller.inject_wire(to_controller=wire)
    with pytest.raises(DeviceError) as raised:
        world.record()
    world.end()
    path = np.array([row[:4] for row in world.path])
    moved = path[(path[:, 0] > changed[0]) & (path[:, 3] < path[path[:, 0] <= changed[0]][-1, 3] - 1e-6)]
    return world, raised.value, moved


@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
def test_an_echo_stops_a_changed_line_before_the_tip_touches(tmp_path, firmware):
    _, error, moved = played(tmp_path, deeper, True, firmware)
    assert re.search(r"the line '.*Z-38.8000.*' came back as '.*Z-48.8000.*': it was changed on its way", error.given)
    assert moved[:, 3].min(initial=0.0) > ORIGIN[2], "the press begins 0.3 mm above the skin"
    assert "lifted off the skin" in "".join(error.__notes__) or "stands clear" in "".join(error.__notes__)


def test_without_an_echo_it_is_noticed_when_the_reports_leave_the_path(tmp_path):
    _, error, moved = played(tmp_path, deeper, False)
    assert "mm off its way" in error.given
    # Noticed where the press should have ended: 0.8 mm deep, one report and the braking later.
    assert ORIGIN[2] - 0.8 - 0.5 < moved[:, 3].min() < ORIGIN[2] - 0.8


def test_a_recording_says_whether_its_lines_were_checked(tmp_path):
    for echo in (False, True):
        world = World(
            4, tmp_path / f"rig {echo}" / "session", presses=1, echo=echo
        )  # a rig each: the tip was left elsewhere
        session = world.record()
        world.end()
        attached = read_records(session.episodes[0]).attachments["controller.json"].data
        assert json.loads(attached)["settings"].get("line_check") == ("echo" if echo else None)


HALF = b"G53G90G94G21G1X-96.0000Y-61.5000Z-45.0000F600.000"
"""A line of motion, 7 mm into the skin, without its end."""


@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
@pytest.mark.parametrize("left", [HALF, b""])
def test_what_an_earlier_program_left_is_neither_carried_out_nor_taken_for_an_answer(tmp_path, firmware, left):
    world, asked = World(4, tmp_path / "session", presses=1, firmware=firmware), []

    def change(data):
        if asked or not data.startswith(b"$"):
            return data
        asked.append(data)
        for k in range(0 if left else 6):  # answers to lines of before, as they come from a controller that was slow
            at = world.schedule.now_ns + k * 8_000_000
            world.schedule.at(at, lambda: world.controller.inject_bytes(b"ok\r\n"))
        return left + data

    world.cnc_line.to_device.change = change
    session = world.record()
    world.end()
    assert asked and len(session.done) == 1
    assert min(row[3] for row in world.path) > ORIGIN[2] - 0.81, "only the press went into the skin"


def test_reports_that_cannot_be_read_are_counted_in_the_file_and_told_by_check(tmp_path):
    world, seen = World(5, tmp_path / "session", presses=1), [0]

    def broken(text):
        if not text.startswith("<"):
            return text
        seen[0] += 1
        return text.replace("MPos:", "MP") if seen[0] % 7 == 0 else text

    world.schedule.at(round(2e9), lambda: world.controller.inject_wire(to_host=broken))
    assert len(world.record().done) == 1
    world.end()
    counted = read_recording(world.folder / "episode-000000.mcap").counts["cnc"]["corrupt"]
    assert 2 <= counted <= seen[0] // 7
    assert f"{counted} status reports could not be read" in check(world.folder).text


@pytest.mark.parametrize(("seconds", "told"), [(0.05, False), (1.2, True)])
def test_a_controller_that_stands_still_in_mid_press_is_told_by_check(tmp_path, seconds, told):
    world = World(3, tmp_path / "session")
    world.schedule.at(round(4.6e9), lambda: world.controller.inject_stall(seconds))
    assert len(world.record().done) == 2
    world.end()
    report = check(world.folder)
    found = [finding for finding in report.findings if "may have stood still" in finding.text]
    assert bool(found) == told, report.text
    assert report.usable != told
