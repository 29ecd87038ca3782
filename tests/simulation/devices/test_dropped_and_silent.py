"""A queue that was dropped, a stuck line, a silent camera and a slow disk: told soon, and no other stream waits."""

import numpy as np
import pytest
from schedule import SECOND
from simulated_rig import CLEARANCE, ORIGIN, WATCHED, World
from simulated_run import Run

from tacdata.recording.files.reader import read_recording

PRESSING, RELEASING = 7.0, 8.5
"""Times at which the tip is on its way into the skin, and out [s]."""
TOLD = 4.5
"""Time in which a dropped move is told [s]: its duration and a third, and a second more."""
SILENT = 3.2
"""Time in which a silent device is told [s]."""
FRAME, REPORT = 0.06, 0.3
"""Longest time between two arrivals of a board of 30 Hz, and of a controller that is asked at 8 Hz [s]."""


@pytest.fixture
def world(tmp_path):
    made = World(3, tmp_path / "session", camera=True)
    yield made
    made.end()


def begun_at(world, seconds, act):
    world.schedule.at(round(seconds * SECOND), act)


def streams(path):
    """The longest intervals of a recording's frames and reports [s]; no frame of its board is missing."""
    episode = read_recording(path).episode
    assert np.all(np.diff(episode.taxels.counter) == 1)
    return np.diff(episode.taxels.arrival_ns).max() / SECOND, np.diff(episode.cnc.sample_ns).max() / SECOND


@pytest.mark.parametrize("at", [0.6, 7.2, RELEASING])
@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
def test_a_queue_that_was_dropped_is_no_override(tmp_path, firmware, at):
    world = World(5, tmp_path / "session", presses=1, firmware=firmware)

    def drop():
        """Stop the motors, and lose the answer of the line after that move."""
        world.controller._faults.put(lambda now_ns: world.controller.planner.stop(now_ns))
        lost = []
        world.controller.inject_wire(to_host=lambda text: text if text != "ok" or lost else lost.append(text))

    begun_at(world, at, drop)
    run = Run(world)
    world.end()
    assert "stands idle at" in str(run.error), run.words
    assert "the controller dropped the move" in str(run.error)
    assert "override" not in run.words
    assert world.stops[0] - at < TOLD
    assert run.here[2] > ORIGIN[2] + CLEARANCE - 0.02, "it was lifted"


@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
def test_a_press_that_was_not_carried_out_is_no_complete_file(tmp_path, firmware):
    world = World(5, tmp_path / "session", presses=1, firmware=firmware)
    depth = f"Z{ORIGIN[2] - 0.8:.3f}"

    def stays(line):
        """A line whose letters were damaged on their way, so that it moves nothing, and is answered."""
        return "G4P0" if depth in line or "Z-38.0" in line else line

    world.controller.inject_wire(to_controller=stays)
    run = Run(world)
    world.end()
    assert "the controller dropped the move" in str(run.error), run.words
    assert "data:   0 of 1 presses are complete" in run.words
    assert run.here[2] > ORIGIN[2] + CLEARANCE - 0.02


def test_a_stuck_line_is_told_within_seconds(world):
    def stick():
        for way in (world.cnc_line.to_host, world.cnc_line.to_device):
            way.change = lambda data: b""

    begun_at(world, PRESSING, stick)
    run = Run(world)
    assert "motion controller: nothing received for 3 s" in run.words
    assert "zero:   LOST" in run.words
    assert world.stops[0] - PRESSING < SILENT
    assert run.end - PRESSING < SILENT + 1.0


def test_a_silent_camera_holds_up_no_other_stream(world):
    begun_at(world, PRESSING, lambda: setattr(world.camera, "hangs_until_ns", 1 << 62))
    run = Run(world)
    assert "camera side: nothing received for 3 s" in run.words, run.words
    (path,) = world.folder.glob("*.interrupted-*.mcap")
    frame, report = streams(path)
    assert frame < FRAME
    assert report < REPORT
    assert run.here[2] > ORIGIN[2] + CLEARANCE - 0.02, "it was lifted"


@pytest.mark.parametrize("begin", [PRESSING, 11.5], ids=["in a press", "at the end of a file"])
def test_a_disk_that_stands_still_for_a_minute_costs_no_frame(world, begin):
    world.schedule.extend(300.0)
    world.computer.disk.slow.append((round(begin * SECOND), round((begin + 60.0) * SECOND)))
    run = Run(world)
    assert run.error is None, run.words
    assert run.end > begin + 60.0
    for path in sorted(world.folder.glob("*.mcap")):
        frame, report = streams(path)
        assert frame < FRAME
        assert report < REPORT
    low = sum(row[3] < ORIGIN[2] - 0.05 for row in world.path) * WATCHED
    assert low < 11.0, "two presses of 5 s: the tip waits for no disk in the skin"
