"""A controller that lost its position while the tip is in the skin homes only after a person said that it is free."""

import pytest
from simulated_rig import ORIGIN, World

from tacdata.errors import DeviceError


@pytest.fixture
def world(tmp_path):
    """A world whose first recording ended in mid-press, with a power cut of the controller."""
    world = World(1, tmp_path / "session")
    world.schedule.at(round(7e9), world.controller.inject_brown_out)
    with pytest.raises(DeviceError, match="was reset in mid-stream"):
        world.record(home=True)
    assert world.position()[2] < ORIGIN[2]
    world.reboot()
    yield world
    world.end()


def test_without_an_answer_it_does_not_home(world):
    before = world.position()
    with pytest.raises(DeviceError, match="was not homed: the controller was reset in mid-stream") as error:
        world.record(resume=True, home=True)
    assert "its position is lost" in str(error.value)
    last = "".join(error.value.__notes__)
    assert "motion: nothing was moved" in last
    assert "zero:   LOST: do not trust the position that the machine reports" in last, "the session remembers it"
    assert "then:   find its zero again (home it, or touch off), then the same command with --resume" in last
    assert (world.position() == before).all()


def test_after_a_yes_it_homes_and_asks_nothing_more(world):
    world.answer = lambda question: True
    with pytest.raises(DeviceError, match="outside the envelope"):  # its switches are far from the skin
        world.record(resume=True, home=True)
    assert len(world.asked) == 1
    assert world.position() == pytest.approx([-1.0, -1.0, -1.0]) and not world.lost
    assert "about to home: every axis moves" in world.asked[0]
