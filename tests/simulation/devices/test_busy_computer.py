"""A computer that is too busy: what waits unread in a port is no silence, and the words name the computer."""

import pytest
from schedule import SECOND
from simulated_rig import CLEARANCE, ORIGIN, World
from simulated_run import Run

HOLDING = 6.0
"""Time at which the tip holds in the skin [s]."""
CLEAR = ORIGIN[2] + CLEARANCE - 0.02


def starved(folder, thread, seconds, **entries):
    """Record one press while one thread of the computer does not run; return the run."""
    world = World(5, folder / "session", presses=1, **entries)
    world.computer.starved.append((thread, round(HOLDING * SECOND), round((HOLDING + seconds) * SECOND)))
    try:
        return Run(world)
    finally:
        world.end()


def test_reports_that_wait_unread_are_no_silence_of_the_controller(tmp_path):
    run = starved(tmp_path, "grbl-listen", 4.0)
    assert "motion controller: nothing received for 3 s, while this computer was" in str(run.error), run.words
    assert "end other programs on this computer" in str(run.error)
    assert run.here[2] > CLEAR, run.words
    assert "LOST" not in run.words, "nothing was lost"


@pytest.mark.parametrize(("seconds", "ends"), [(2.4, False), (6.0, True)])
def test_frames_that_wait_unread_are_no_silence_of_the_board_for_as_long_again(tmp_path, seconds, ends):
    run = starved(tmp_path, "taxel-board", seconds)
    if not ends:
        assert run.error is None, run.words
        return
    assert "taxel board: nothing received for 1.8 s, while this computer was" in str(run.error), run.words
    assert "end other programs on this computer" in str(run.error)
    assert run.world.stops[0] - HOLDING < 4.0
    assert run.here[2] > CLEAR, run.words


@pytest.mark.parametrize(("seconds", "ends"), [(4.0, False), (30.0, True)])
def test_an_emulated_controller_may_be_late_for_longer_than_a_real_one(tmp_path, seconds, ends):
    """It runs on this computer, which keeps it from answering: 3 s are the silence of a real one."""
    world = World(5, tmp_path / "session", presses=1, speed=4.0)
    at = round(1.6 * SECOND)

    def hold():
        for way in (world.cnc_line.to_host, world.cnc_line.to_device):
            way.held_until = at + round(seconds * SECOND)

    world.schedule.at(at, hold)
    try:
        run = Run(world)
    finally:
        world.end()
    assert (run.error is not None) == ends, run.words
    assert run.end - 1.6 < 15.0
