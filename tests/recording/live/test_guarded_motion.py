"""Whatever goes wrong: hold first, nothing sent after, straight up only when the position is known."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from device_doubles import Controller

from tacdata.clock import Clock
from tacdata.devices.device import StandsStill
from tacdata.errors import DeviceError
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.motion.press_steps import Step

AT = (10.0, 20.0, -20.0)
PATH = (Step("press", (10.0, 20.0, -25.0), 2.0), Step("hold", seconds=5.0), Step("", (40.0, 20.0, -25.0), 5.0))
HEIGHT = -18.0


@pytest.fixture
def bench():
    clock = Clock.start(10.0)
    cnc = Controller(clock, AT)
    streams = SimpleNamespace(fault=None, position=None)
    return SimpleNamespace(cnc=cnc, motion=GuardedMotion(cnc, clock), streams=streams)


def fail(bench, seconds):
    """A stream fails so long after now [s, real time], as `RigStreams` does it: stop first, then say why."""

    def later():
        bench.motion.stop()
        bench.streams.fault = DeviceError("the board is gone", "a board", "plug it in")

    threading.Timer(seconds, later).start()


def after_the_hold(calls):
    return calls[calls.index("feed_hold") + 1 :]


@pytest.mark.parametrize("seconds", [0.1, 0.4], ids=["moving", "in a pause"])
def test_the_streams_own_words_are_raised_and_the_lift_is_straight_up(bench, seconds):
    fail(bench, seconds)
    with pytest.raises(DeviceError, match="the board is gone"):
        bench.motion.drive(PATH, AT, bench.streams, None)
    x, y, z = bench.cnc.position()
    assert (x, y) == AT[:2]
    said = bench.motion.lift(HEIGHT, 5.0)
    assert f"straight up from {z:.3f}" in said
    np.testing.assert_allclose(bench.cnc.position(), [10, 20, HEIGHT], atol=1e-6)
    moves = [call[1] for call in after_the_hold(bench.cnc.calls) if call[0] == "move"]
    assert moves == [(10.0, 20.0, HEIGHT)], "nothing but the lift goes out after the hold"


def test_no_lift_without_a_known_position(bench):
    bench.cnc.abandon = lambda: (_ for _ in ()).throw(DeviceError("its position is lost", "-", "home it"))
    fail(bench, 0.1)
    with pytest.raises(DeviceError, match="the board is gone"):
        bench.motion.drive(PATH, AT, bench.streams, None)
    count = len(bench.cnc.calls)
    assert "not lifted (its position is lost)" in bench.motion.lift(HEIGHT, 5.0)
    assert not [call for call in bench.cnc.calls[count:] if call[0] == "move"]


@pytest.mark.parametrize(
    ("z", "words"), [(-5.0, "stands clear of the skin, at machine height -5.000"), (-24.0, "was not lifted")]
)
def test_a_machine_that_parked_itself_at_the_door_is_not_said_to_be_in_the_skin(bench, z, words):
    open_door = StandsStill("the safety door is open", "a closed door", "close it", (10.0, 20.0, z))
    bench.cnc.abandon = lambda: (_ for _ in ()).throw(open_door)
    fail(bench, 0.1)
    with pytest.raises(DeviceError, match="the board is gone"):
        bench.motion.drive(PATH, AT, bench.streams, None)
    assert words in bench.motion.lift(HEIGHT, 5.0)
    assert words in bench.motion.ending[1]
    assert not bench.motion.lifted, "nothing may follow before the door is closed"


def test_no_lift_when_nothing_was_stopped(bench):
    assert "not lifted" in bench.motion.lift(HEIGHT, 5.0)
    assert bench.cnc.calls == []


def test_one_who_is_high_already_is_not_lowered(bench):
    fail(bench, 0.05)
    with pytest.raises(DeviceError):
        bench.motion.drive((Step("", (10.0, 20.0, -15.0), 2.0),), AT, bench.streams, None)
    before = bench.cnc.position()
    bench.motion.lift(-30.0, 5.0)
    np.testing.assert_array_equal(bench.cnc.position(), before)


def test_a_fault_between_two_paths_keeps_the_next_one_from_starting(bench):
    bench.motion.stop()
    bench.streams.fault = DeviceError("the board is gone", "a board", "plug it in")
    with pytest.raises(DeviceError, match="the board is gone"):
        bench.motion.drive(PATH, AT, bench.streams, None)
    assert not [call for call in bench.cnc.calls if call[0] == "move"]
