"""The last lines on the screen, read as the person at the rig: what moved, where the tip is, what is kept, what comes.

Each ending is played in the simulated world, and its words are held against where the tip truly is.
"""

import re
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from simulated_rig import ORIGIN, PARKED, World
from simulated_run import Run

from tacdata.errors import DeviceError

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "recording_faults.md"
MS = 1_000_000
DEEPEST, HELD = ORIGIN[2] - 0.7999, 0.5
"""Height of the first press's hold [mm], and a time in the hold [s]: reports then state this height."""
TAPPING = ORIGIN[2] - 0.3
"""Height on the way down of a sync tap [mm]; the report before is from within the skin, too."""
TRAVELLING = ORIGIN[2] + 10.0
"""Height of the first travel [mm], far above the skin."""
HERE = r"\(-\d+\.\d\d, -\d+\.\d\d, -38\.80\) mm"
LIFTED = r"the indenter was lifted off the skin, straight up from -38\.80\d to -35\.000 mm"
LEFT = "the indenter was not lifted; leave it, the next start lifts it straight up"
UNSEEN = "the indenter was not lifted; leave it, the next start asks, then lifts it straight up"
LOST = "LOST: do not trust the position that the machine reports"
BY_HAND = "the indenter was not lifted; free it by hand"
AGAIN = "the same command with --resume"
FOUND = f"find its zero again (home it, or touch off), then {AGAIN}"


def interrupt(*after_ms):
    """Press Ctrl-C now, and so much later."""

    def act(world):
        now = world.schedule.now_ns
        world.computer.send_signal(signal.SIGINT)
        for ms in after_ms:
            world.schedule.at(now + ms * MS, lambda: world.computer.send_signal(signal.SIGINT))

    return act


def stall(world):
    now = world.schedule.now_ns
    world.computer.stalls.append((now, now + 6000 * MS))


ENDINGS = {
    # what happens: (the error's first words, motion, tip, zero, then)
    "hard limit": (
        lambda w: w.controller.inject_alarm(1),
        r"the controller stopped with ALARM:1",
        f"stopped; it last reported {HERE}",
        BY_HAND,
        LOST,
        FOUND,
    ),
    "soft limit": (
        lambda w: w.controller.inject_alarm(2),
        r"the controller stopped with ALARM:2",
        f"stopped; it last reported {HERE}",
        LEFT,
        None,
        AGAIN,
    ),
    "brown-out": (
        lambda w: w.controller.inject_brown_out(),
        "the controller was reset in mid-stream",
        f"stopped; it last reported {HERE}",
        BY_HAND,
        LOST,
        FOUND,
    ),
    "another program's reset": (
        lambda w: w.controller.inject_reset(),
        "the controller was reset in mid-stream",
        f"stopped; it last reported {HERE}",
        BY_HAND,
        LOST,
        FOUND,
    ),
    "cable": (
        lambda w: w.cnc_line.close(),
        "the line to the controller on .* broke",
        f"NOT KNOWN to have stopped; it last reported {HERE}; if it moves, press the emergency stop",
        BY_HAND,
        LOST,
        FOUND,
    ),
    "mute controller": (
        lambda w: w.controller.inject_wire(to_host=lambda text: None),
        "motion controller: nothing",
        rf"NOT KNOWN to have stopped \(.* is silent: .*\); it last reported {HERE}; if it moves, .*",
        BY_HAND,
        LOST,
        FOUND,
    ),
    "door": (
        lambda w: w.controller.inject_door(True),
        "the safety door was opened",
        rf"stopped \(the safety door is open; the machine stands at {HERE}\)",
        LEFT,
        None,
        AGAIN,
    ),
    "pendant": (
        lambda w: w.controller.inject_pendant(),
        "a pendant has taken control",
        rf"stopped \(a pendant has control of the machine, which stands at {HERE}\)",
        LEFT,
        None,
        AGAIN,
    ),
    "foreign hold": (
        lambda w: w.controller.inject_byte(0x21),
        "someone held the motion",
        f"stopped at {HERE}",
        LIFTED,
        None,
        AGAIN,
    ),
    "board unplugged": (
        lambda w: w.board_line.close(),
        "the line to the taxel board",
        f"stopped at {HERE}",
        LIFTED,
        None,
        AGAIN,
    ),
    "saturated board": (
        lambda w: w.board.inject_readings(lambda counts: np.full_like(counts, 65535.0)),
        "taxels: all 24 channels have read 65535",
        f"stopped at {HERE}",
        LIFTED,
        None,
        AGAIN,
    ),
    "full disk": (
        lambda w: setattr(w.computer.disk, "room", 100),
        "writing failed: .*No space left",
        f"stopped at {HERE}",
        LIFTED,
        None,
        AGAIN,
    ),
    "closed lid": (stall, "this computer stood still for 6.0 s", f"stopped at {HERE}", LIFTED, None, AGAIN),
    "Ctrl-C": (interrupt(), "", f"stopped at {HERE}", LIFTED, None, AGAIN),
    "three Ctrl-C": (
        interrupt(50, 100),
        "",
        rf"NOT KNOWN to have stopped \(interrupted while it was being stopped\); it last reported {HERE}; "
        "if it moves, press the emergency stop",
        UNSEEN,
        None,
        AGAIN,
    ),
}


def ended(folder, act, height=DEEPEST, after=HELD):
    """Play a run in which something happens once the tip is down at a height; return it, and its last lines by tag."""
    made = World(3, folder / "session")
    made.when_down_at(height, lambda: act(made), after)
    try:
        run = Run(made)
    finally:
        made.end()
    lines = {}
    for note in getattr(run.error, "__notes__", ()):
        for line in note.splitlines():
            tag, _, words = line.strip().partition(":")
            lines.setdefault(tag, []).append(words.strip())
    return run, lines


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """Plays each ending in mid press once; returns its run, its last lines and its folder."""
    known = {}

    def played(name):
        if name not in known:
            folder = tmp_path_factory.mktemp("ending")
            known[name] = *ended(folder, ENDINGS[name][0]), folder
        return known[name]

    return played


@pytest.mark.parametrize("name", ENDINGS)
def test_the_last_lines_are_true_and_say_what_comes_next(pressed, name):
    _, error, motion, tip, zero, then = ENDINGS[name]
    run, lines, _ = pressed(name)
    assert re.match(error, str(run.error)), run.error
    assert re.fullmatch(motion, lines["motion"][0]), lines
    assert re.fullmatch(tip, lines["tip"][0]), lines
    assert ("zero" in lines) == (zero is not None)
    assert zero is None or re.fullmatch(zero, lines["zero"][0]), lines
    assert lines["then"] == [then]
    assert list(lines) == [tag for tag in ("motion", "tip", "zero", "data", "then") if tag in lines], "in this order"
    assert lines["data"][0].startswith("0 of 2 presses are complete in")
    assert re.fullmatch(r"broken off, readable: episode-000000\.(interrupted-0|partial)\.mcap", lines["data"][1])
    assert (run.here[2] > -35.02) == (tip == LIFTED), "the tip is where the words say"
    assert not run.moves_at_the_end
    reason = getattr(run.error, "given", "no reason")
    assert not any(reason in line for said in lines.values() for line in said), "nothing is said twice"


TAPPED = ("hard limit", "cable", "door", "pendant", "foreign hold", "board unplugged", "Ctrl-C")


@pytest.mark.parametrize("name", TAPPED)
def test_a_sync_tap_ends_in_the_same_words(tmp_path, name):
    act, error, motion, tip, zero, then = ENDINGS[name]
    made = World(3, tmp_path / "session")
    made.when_down_at(TAPPING, lambda: act(made))
    with pytest.raises((DeviceError, KeyboardInterrupt)) as raised:
        made.record(sync_tap=True)
    made.end()
    lines = "".join(raised.value.__notes__)
    assert re.match(error, str(raised.value))
    for words in (motion, tip, *([zero] if zero else []), re.escape(then)):
        assert re.search(words.replace(r"-38\.80", r"-38\.\d\d"), lines), lines
    assert "0 of 2 presses are complete" in lines
    assert ("zero:" in lines) == (zero is not None)
    assert (made.position()[2] > -35.02) == (tip == LIFTED), "the tip is where the words say"


def test_a_tip_high_above_the_skin_is_not_said_to_have_been_lifted(tmp_path):
    run, lines = ended(tmp_path, interrupt(), TRAVELLING, 0.0)
    assert lines["motion"][0].startswith("stopped at")
    stands = re.fullmatch(r"the indenter stands clear of the skin, at machine height (\S+) mm", lines["tip"][0])
    assert stands, lines
    assert float(stands[1]) == pytest.approx(run.here[2], abs=0.002)


def test_before_the_first_move_nothing_was_moved_or_written(tmp_path):
    run, lines = ended(tmp_path, interrupt(), ORIGIN[2] + PARKED, 0.05)
    assert isinstance(run.error, KeyboardInterrupt)
    assert lines["motion"] == ["nothing was moved"]
    assert lines["data"] == ["nothing was written"]
    assert lines["then"] == ["the same command"]
    assert "tip" not in lines


def printed(run, folder):
    """Return what the screen shows at the end, as the page on faults prints it."""
    words = run.words.strip("\n").replace(str(folder / "session"), "SESSION")
    return re.sub(r"sim://\d+/", "/dev/tty-", words)


def sample(run, folder):
    """Return an ending as a block of the page."""
    return f"```text\n{printed(run, folder)}\n```"


@pytest.mark.parametrize("name", ENDINGS)
def test_the_page_on_faults_shows_what_is_printed(pressed, name):
    run, _, folder = pressed(name)
    assert sample(run, folder) in PAGE.read_text(), "write it with `python tests/simulation/test_endings.py`"


def write_page():
    """Write the samples of the page anew."""
    text = PAGE.read_text()
    for name in ENDINGS:
        with tempfile.TemporaryDirectory() as folder:
            run, _ = ended(Path(folder), ENDINGS[name][0])
            block = sample(run, Path(folder))
        head = f"### {name[0].upper()}{name[1:]}\n\n"
        before, after = text.split(head)
        text = before + head + block + after.partition("\n```")[2]
    PAGE.write_text(text)


if __name__ == "__main__":
    sys.path.append(str(Path(__file__).parents[1]))  # pyserial imports the lines by this folder's name
    write_page()
