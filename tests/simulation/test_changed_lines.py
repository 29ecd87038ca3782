"""A line to the controller that is changed on its way: with an echo nothing of it is carried out for long."""

import json
import re

import numpy as np
import pytest
from simulated_rig import ORIGIN, World

from tacdata.errors import DeviceError
from tacdata.recording.files.mcap_records import read_records

PRESSING = "F30.000"
"""What lines of the press and of the release end with: 0.5 mm/s."""


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
    world, error, moved = played(tmp_path, deeper, True, firmware)
    assert re.search(r"the line '.*Z-38.8000.*' came back as '.*Z-48.8000.*': it was changed on its way", error.given)
    assert moved[:, 3].min(initial=0.0) > ORIGIN[2], "the press begins 0.3 mm above the skin"
    assert "lifted off the skin" in "".join(error.__notes__) or "stands clear" in "".join(error.__notes__)
    world.controller.inject_wire(to_controller=lambda line: line)


def test_without_an_echo_it_is_noticed_when_the_reports_leave_the_path(tmp_path):
    _, error, moved = played(tmp_path, deeper, False)
    assert "mm off its way" in error.given
    # Noticed where the press should have ended: 0.8 mm deep, one report and the braking later.
    assert ORIGIN[2] - 0.8 - 0.5 < moved[:, 3].min() < ORIGIN[2] - 0.8


def test_a_recording_says_whether_its_lines_were_checked(tmp_path):
    for echo in (False, True):
        world = World(4, tmp_path / f"session {echo}", presses=1, echo=echo)
        session = world.record()
        world.end()
        attached = read_records(session.episodes[0]).attachments["controller.json"].data
        assert json.loads(attached)["settings"].get("line_check") == ("echo" if echo else None)
