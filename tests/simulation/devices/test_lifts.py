"""A lift is watched as any path is, tried again where the controller obeys, and reported as it ended."""

import re
import signal
from types import SimpleNamespace

import pytest
from drawn_faults import AtALine
from simulated_rig import ORIGIN, Calm, World
from simulated_run import Run, broken

from tacdata.errors import DeviceError
from tacdata.recording.motion.allowed_path import AllowedPath

PRESSING = 7_000_000_000
"""Time at which the tip is in the skin [ns]."""
DEEP = 0.8
"""Depth of the press [mm]."""
RISE = re.compile(r"G1Z-(\d)(\d)")
"""A line of a lift: it names no x and y."""
DEEPER, SHORT = (10, 1)
"""Changes of a lift's target by one digit [mm, downwards]: into the skin, and 2 mm above it."""


@pytest.fixture
def lifted(tmp_path):
    """Breaks a press off; the lifts' lines of the given numbers are damaged. Returns world and words."""
    made = []

    def play(damaged, change=DEEPER):
        world = World(1, tmp_path / "session")
        made.append(world)
        count = []

        def wire(line):
            if not RISE.search(line):
                return line
            count.append(line)
            if len(count) in damaged:
                return RISE.sub(lambda match: f"G1Z-{int(match[1] + match[2]) + change}", line)
            return line

        world.controller.inject_wire(to_controller=wire)
        world.schedule.at(PRESSING, lambda: world.board_line.close())
        with pytest.raises(DeviceError, match="taxel board") as raised:
            world.record()
        return world, "\n".join(raised.value.__notes__)

    yield play
    for world in made:
        world.end()


def deepest(world):
    return ORIGIN[2] - min(row[3] for row in world.path)


def test_a_damaged_lift_is_stopped_near_its_place_and_tried_again(lifted):
    world, words = lifted({1})
    assert deepest(world) < DEEP + 0.7
    assert world.position()[2] == pytest.approx(ORIGIN[2] + 3.0, abs=0.01)
    assert re.search(r"tip:    the indenter was lifted off the skin, .* at the attempt number 2", words), words
    assert "on its way" not in words


def test_two_damaged_lifts_are_followed_by_a_third(lifted):
    world, words = lifted({1, 2})
    assert world.position()[2] == pytest.approx(ORIGIN[2] + 3.0, abs=0.01)
    assert "lifted off the skin" in words
    assert "attempt number 3" in words


def test_a_lift_that_never_goes_up_is_reported_where_it_stands(lifted):
    world, words = lifted(set(range(1, 20)))
    place = world.position()
    assert place[2] < ORIGIN[2]
    assert deepest(world) < DEEP + 3 * 0.7
    assert "the indenter was not lifted all the way" in words
    stands = re.search(r"motion: stopped at \((\S+), (\S+), (\S+)\) mm", words)
    assert [float(value) for value in stands.groups()] == pytest.approx(place.tolist(), abs=0.02), words
    assert "on its way" not in words.split("motion:")[1].splitlines()[0]


def test_a_lift_that_ends_too_low_is_noticed_and_tried_again(lifted):
    world, words = lifted({1}, SHORT)
    assert world.position()[2] == pytest.approx(ORIGIN[2] + 3.0, abs=0.01)
    assert "straight up from -36.000 to -35.000 mm, at the attempt number 2" in words


def test_lifts_that_all_end_too_low_are_reported_where_they_ended(lifted):
    world, words = lifted(set(range(1, 20)), SHORT)
    assert world.position()[2] == pytest.approx(ORIGIN[2] + 2.0, abs=0.01)
    assert (
        "not lifted all the way: the lift ended at (-95.05, -60.91, -36.00) mm, not at (-95.05, -60.91, -35.00)"
        in words
    )
    assert "motion: stopped at (-95.05, -60.91, -36.00) mm" in words


def test_an_undamaged_lift_is_one_attempt(lifted):
    world, words = lifted(set())
    assert world.position()[2] == pytest.approx(ORIGIN[2] + 3.0, abs=0.01)
    assert "attempt" not in words


def lost_reset(world):
    """Lose the first reset on its way to the controller."""
    left = [1]

    def change(data):
        if data == b"\x18" and left:
            left.clear()
            return b""
        return data

    world.cnc_line.to_device.change = change


def lost_welcome(world):
    """Lose the first welcome on its way to the computer."""
    left = [1]

    def wire(text):
        if text.startswith("Grbl") and left:
            left.clear()
            return None
        return text

    world.controller.inject_wire(to_host=wire)


def late_reset(world):
    """Hold back what is sent from the reset on, longer than one attempt waits."""
    way = world.cnc_line.to_device

    def change(data):
        if data == b"\x18" and not way.held_until:
            way.held_until = world.schedule.now_ns + 2_700_000_000
        return data

    way.change = change


@pytest.mark.parametrize("fault", [lost_reset, lost_welcome, late_reset])
def test_a_reset_that_nobody_answers_is_tried_again_before_the_lift(tmp_path, fault):
    world = World(1, tmp_path / "session")
    broken = []

    def pull():
        fault(world)
        broken.append(world.schedule.now)
        world.board_line.close()

    world.schedule.at(PRESSING, pull)
    with pytest.raises(DeviceError, match="taxel board") as raised:
        world.record()
    world.end()
    assert "the indenter was lifted off the skin" in "\n".join(raised.value.__notes__)
    clear = next(t for t, _, _, z, *_ in world.path if t > broken[0] and z > ORIGIN[2] + 2.9)
    assert clear - broken[0] < 6.0
    assert not world.lost


@pytest.mark.parametrize("lines", range(1, 13))
def test_a_signal_as_a_lift_ends_leaves_true_words(tmp_path, monkeypatch, lines):
    """A second Ctrl-C at each line from the last look at the lift on; the words once named where it had begun."""
    world, is_short = World(1, tmp_path / "session"), AllowedPath.is_short
    faults = SimpleNamespace(world=world, over=False, see=lambda name: None)
    watchers = []

    def look(path, target, position):
        watchers.append(AtALine(faults, signal.SIGINT, lines))
        return is_short(path, target, position)

    monkeypatch.setattr(AllowedPath, "is_short", look)
    world.schedule.at(PRESSING, lambda: world.computer.send_signal(signal.SIGINT))
    run = Run(world)
    world.end()
    (watcher,) = watchers
    assert watcher.left == 0 and isinstance(run.error, KeyboardInterrupt)
    assert run.here[2] == pytest.approx(ORIGIN[2] + 3.0, abs=0.01)
    assert not list(broken(run, Calm()))
