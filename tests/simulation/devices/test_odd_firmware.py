"""Firmwares, pendants and second programs that do otherwise than Grbl's documentation says, while the tip presses."""

import re

import numpy as np
import pytest
from simulated_rig import CLEARANCE, ORIGIN, World
from simulated_run import Run

from tacdata.errors import DeviceError

PRESSING = 4.9
"""Time at which the tip goes down into the skin [s]."""
HOLDING = 6.0
"""Time at which it holds in the skin [s]."""


def reports(change):
    """What the wire does to status reports alone."""
    return lambda text: change(text) if text.startswith("<") else text


BARE = reports(lambda text: re.sub(r"^<(Hold|Door):\d", r"<\1", text))
"""Reports without substates, as old firmwares write them."""


def wire(change):
    return lambda world: world.controller.inject_wire(to_host=change)


def play(folder, act, at=None, **world):
    """Record one press while something is odd, from a time on [s] or from the start; return the run and its words."""
    made = World(5, folder / "session", presses=1, **world)
    if at is None:
        act(made)
        made.schedule.run_for(0.05, made.bench)
    else:
        made.schedule.at(round(at * 1e9), lambda: act(made))
    try:
        run = Run(made)
    finally:
        made.end()
    return run, run.words


def line_ends(end):
    def act(world):
        write = world.cnc_line.write
        world.cnc_line.write = lambda data: write(data.replace(b"\r\n", end))

    return act


def field(pattern, new):
    return reports(lambda text: re.sub(pattern, new, text))


def some(pattern, new, every):
    """Change one report in so many."""
    count = [0]

    def change(text):
        count[0] += 1
        return text if count[0] % every else re.sub(pattern, new, text)

    return reports(change)


def pausing(world):
    """Report pauses as GRBL-Advanced does."""
    machine = world.controller.machine
    named = reports(lambda text: text.replace("<Idle", "<Dwell") if machine.dwell_ns is not None else text)
    world.controller.inject_wire(to_host=named)


def preset(*lines, offset=(0.0, 0.0, 0.0)):
    """Leave a modal state behind, as another program does, beside an offset of G54 [mm]."""

    def act(world):
        world.controller.machine.offset += offset
        for line in lines:
            other_program(f"{line}\n".encode())(world)

    return act


HAL = {"firmware": "grblHAL"}
BARE_HAL = {**HAL, "settings": {"$10": "0"}}
TAKEN = {
    "grblHAL, $10=0, G54 is set": (preset(offset=(-10.0, 5.0, 2.5)), BARE_HAL),
    "grblHAL, $10=0, G92 is active": (preset("G92X1Y2Z3", offset=(-10.0, 5.0, 2.5)), BARE_HAL),
    "grblHAL, $10=0, a hold was left": (lambda w: w.controller.inject_byte(0x21), BARE_HAL),
    "grblHAL, $10=0, a tool's length is active": (preset("G43.1Z7"), BARE_HAL),
    "Grbl, $10=0, G92 is active": (preset("G92X1Y2Z3", offset=(-10.0, 5.0, 2.5)), {"settings": {"$10": "0"}}),
    "grblHAL, axes are scaled": (preset("G51X2Z3"), HAL),
    "grblHAL tells its modal state unasked": (
        wire(reports(lambda text: f"{text}\r\n[GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F300 S0]")),
        HAL,
    ),
    "grblHAL, inches": (lambda world: None, {**HAL, "settings": {"$13": "1"}}),
    "grblHAL, all of $10": (lambda world: None, {**HAL, "settings": {"$10": "4095"}}),
    "grblHAL, all of homing": (lambda world: None, {**HAL, "settings": {"$22": "7"}}),
    "laser mode": (lambda world: None, {"settings": {"$32": "1"}}),
    "Run has substates": (wire(field("^<Run", "<Run:2")), HAL),
    "pauses have a state": (pausing, {}),
    "messages before each answer": (wire(lambda text: "[MSG:INFO: x]\r\nok" if text == "ok" else text), {}),
    "MPG:0 in each report": (wire(field(">", "|MPG:0>")), HAL),
    "three speeds": (wire(field(r"\|FS:(\d+),\d+", r"|FS:\1,0,0")), HAL),
    "two decimals": (wire(field(r"(\.\d\d)\d(?=[,|>])", r"\1")), {}),
    "rapids at half speed": (wire(field(r"\|Ov:100,100,100", "|Ov:100,50,100")), {}),
    "zero bytes and blanks": (wire(lambda text: f"\x00 {text} \r\n"), {}),
    "one report in seven is cut and begun anew": (wire(some("^", "<Idle|MP", 7)), {}),
    "one report in three has no number": (wire(some(r"MPos:[^|>]*", "MPos:nan,nan,nan", 3)), {}),
    "fields of grblHAL and FluidNC": (wire(field(">", "|A:SFM|FW:grblHAL|MPG:0|H:1,7|TLR:0|T:0|SD:1.2,/a.nc>")), {}),
    "no Bf": (wire(field(r"\|Bf:[^|>]*", "")), {}),
    "F in place of FS": (wire(field(r"\|FS:(\d+),\d+", r"|F:\1")), {}),
    "no feed at all": (wire(field(r"\|FS?:[^|>]*", "")), {}),
    "pins": (wire(field(">", "|Pn:XYZP>")), {}),
    "six axes": (wire(field(r"(Pos:[^|>]*)", r"\1,0.000,0.000,0.000")), {}),
    "every report twice": (wire(reports(lambda text: f"{text}\r\n{text}")), {}),
    "WCO never sent": (wire(field(r"\|WCO:[^|>]*", "")), {"settings": {"$10": "2"}}),
    "inches": (lambda world: None, {"settings": {"$13": "1"}}),
    "motors off after each move": (lambda world: None, {"settings": {"$1": "25"}}),
    "neither homing nor soft limits": (lambda world: None, {"settings": {"$20": "0", "$22": "0"}}),
    "lines end with a line feed": (line_ends(b"\n"), {}),
    "lines end with a carriage return": (line_ends(b"\r"), {}),
    **{
        f"$10={mask}, {firmware}": (lambda world: None, {"settings": {"$10": mask}, "firmware": firmware})
        for mask in ("0", "1", "2", "3", "511")
        for firmware in ("Grbl", "grblHAL")
    },
}


@pytest.mark.parametrize("name", TAKEN)
def test_what_is_only_written_otherwise_is_taken(tmp_path, name):
    act, world = TAKEN[name]
    run, words = play(tmp_path, act, **world)
    assert run.error is None, words
    assert len(run.session.done) == 1


def doubled(times):
    """Answer a line twice, so many times."""
    left = [times]

    def change(text):
        if text == "ok" and left[0]:
            left[0] -= 1
            return "ok\r\nok"
        return text

    return change


def slower(world):
    """Turn the feed down to 50 % in a firmware whose reports do not say so."""
    for _ in range(5):
        world.controller.inject_byte(0x92)
    world.controller.inject_wire(to_host=field(r"\|Ov:[^|>]*", ""))


def other_program(line):
    def act(world):
        world.controller._faults.put(lambda now: [world.controller._take(byte, now) for byte in line])

    return act


def bare(act):
    def both(world):
        world.controller.inject_wire(to_host=BARE)
        act(world)

    return both


def shifted(world):
    """Let somebody shift the work offset, and the report that says so get lost."""
    world.controller.machine.offset += (1.0, 2.0, 3.0)
    world.controller.inject_wire(to_host=field(r"\|WCO:[^|>]*", ""))


def once(line, new):
    """Change the next such line."""
    left = [line]
    return lambda text: new if text in left and not left.clear() else text


def unreadable(times):
    """Spoil so many reports."""
    left = [times]

    def change(text):
        left[0] -= 1
        return re.sub("MPos:[^|>]*", "MPos:nan,nan,nan", text) if left[0] >= 0 else text

    return wire(reports(change))


def noisy(world):
    """Turn what the controller sends into noise for 4 s: no line begins as a report does."""
    end = world.schedule.now + 4.0
    noise = lambda data: bytes(byte ^ 0x41 for byte in data) if world.schedule.now < end else data  # noqa: E731
    world.cnc_line.to_host.change = noise


def strange_hold(world):
    """Hold with a substate that no manual names, while it brakes and at rest."""
    world.controller.inject_wire(to_host=reports(lambda text: re.sub(r"^<Hold:\d", "<Hold:4294967295", text)))
    world.controller.inject_byte(0x21)


LIFTED = "the indenter was lifted off the skin, straight up"
STOPPED = {
    "one answer twice": (wire(doubled(1)), PRESSING, "no line was waiting for an answer", {}),
    "each answer twice": (wire(doubled(10**9)), PRESSING, "no line was waiting for an answer", {}),
    "another program pauses": (other_program(b"G4P1\n"), PRESSING, "no line was waiting for an answer", {}),
    "another program moves": (other_program(b"G0X-90\n"), HOLDING, "off its way", {}),
    "feed turned down, unsaid": (slower, 1.0, "too late", {}),
    "feed turned down, unsaid, grblHAL": (slower, 1.0, "too late", {"firmware": "grblHAL"}),
    "a hold without substate": (bare(lambda w: w.controller.inject_byte(0x21)), PRESSING, "someone held", {}),
    "a fault, then holds without substate": (bare(lambda w: w.board_line.close()), PRESSING, "the taxel board", {}),
    "a hold with a strange substate": (strange_hold, PRESSING, "someone held", HAL),
    "no report can be read for 4 s": (unreadable(32), HOLDING, "reports that cannot be read", {}),
    "a refusal in mid press": (wire(once("ok", "error:79")), PRESSING, "error:79", HAL),
    "work positions shifted, unsaid": (shifted, HOLDING, "off its way", {"settings": {"$10": "2"}}),
}


@pytest.mark.parametrize("name", STOPPED)
def test_what_moves_otherwise_is_stopped_soon_and_lifted_straight_up(tmp_path, name):
    act, at, words, world = STOPPED[name]
    run, said = play(tmp_path, act, at, **world)
    assert words in str(run.error), said
    # Reports that are shifted contradict the lift, too: it went up, and nobody can know it from them.
    assert ("not lifted all the way: the lift ended at" if act is shifted else LIFTED) in said
    assert run.here[2] > ORIGIN[2] + CLEARANCE - 0.02
    times, places, _ = run.path
    rising = (np.diff(places[:, 2]) > 0) & (times[1:] > at)
    low = (places[:-1, 2] < ORIGIN[2]) & (places[1:, 2] < ORIGIN[2])
    sideways = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
    assert name == "another program moves" or sideways[rising & low].max(initial=0.0) < 0.002
    assert run.end - max(at, PRESSING) < 6.0, "nobody waits for long beside a tip in the skin"


def test_noise_is_no_silence_and_the_tip_is_lifted_after_it(tmp_path):
    run, said = play(tmp_path, noisy, HOLDING)
    assert "only reports that cannot be read" in str(run.error), said
    assert LIFTED in said
    assert run.here[2] > ORIGIN[2] + CLEARANCE - 0.02
    assert "LOST" not in said


STATES = {
    "Check": ("check mode", ""),
    "Sleep": ("fell asleep", "free it by hand"),
    "Tool": ("a tool change", ""),
    "Home": ("someone homes", "stopped (the controller stays in state Home; the machine stands at"),
    "Jog": ("someone jogs", "stopped (the controller stays in state Jog; the machine stands at"),
    "Hold": ("someone held the motion", ""),
    "Foo": ("the state 'Foo', which is not known here", ""),
    "Alarm": ("locked (state Alarm)", "LOST"),
    "Alarm:37": ("locked (ALARM:37 (a code of neither", "LOST"),
}


@pytest.mark.parametrize("state", STATES)
def test_a_state_that_no_recording_asks_for_ends_it_within_seconds(tmp_path, state):
    error, ending = STATES[state]
    change = reports(lambda text: re.sub(r"^<[A-Za-z]+(:\d)?", f"<{state}", text))
    run, words = play(tmp_path, wire(change), HOLDING)
    assert error in str(run.error), words
    assert ending in words
    assert run.end - HOLDING < 6.0


def test_one_damaged_state_is_no_state(tmp_path):
    left = [1]
    change = reports(lambda text: text.replace("Idle", "Idlf") if left and not left.clear() else text)
    run, words = play(tmp_path, wire(change), HOLDING)
    assert run.error is None, words


def first_report(words):
    """Say something before the next report."""
    left = [words]
    return reports(lambda text: f"{left.pop()}\r\n{text}" if left else text)


def obeys_after_reset(world):
    """Behave as older grblHAL does after a limit alarm: no line is answered before a reset."""
    controller = world.controller
    controller.inject_alarm(1)
    controller.inject_wire(lambda line: line if 0x18 in [byte for byte, _ in controller.heard] else None)


SINCE_LONG = "a pendant since long, unsaid"
OPENED = {
    "hard limit": (lambda w: w.controller.inject_alarm(1), "locked (ALARM:1 (a hard limit switch closed"),
    "soft limit": (lambda w: w.controller.inject_alarm(2), "unlock it ($X) in a terminal, which keeps the position"),
    "emergency stop": (lambda w: w.controller.inject_alarm(10), "locked (ALARM:10 (the emergency stop is active"),
    "pendant": (lambda w: w.controller.inject_pendant(), "a pendant has control of the controller"),
    "hard limit, Alarm alone in reports": (lambda w: w.controller.inject_alarm(1), "locked (ALARM:1 (a hard limit"),
    "motor fault": (lambda w: w.controller.inject_alarm(17), "locked (ALARM:17 (a motor driver reports a fault"),
    SINCE_LONG: (
        lambda w: w.controller.inject_wire(lambda line: None),
        "answers ? but no line: the controller stands idle and still owes an answer to '$I'",
    ),
    "open door": (lambda w: w.controller.inject_door(True), "close the safety door"),
}


@pytest.mark.parametrize("settings", [{}, {"$10": "0"}])
def test_a_moving_machine_is_not_taken_over(tmp_path, settings):
    move = other_program(b"G53G1X-95F60\n")
    _, said = play(tmp_path, move, firmware="grblHAL", settings=settings)
    assert "is in state Run" in said
    assert "motion: nothing was moved" in said


@pytest.mark.parametrize("name", OPENED)
def test_opening_says_at_once_why_a_controller_obeys_nobody(tmp_path, name):
    act, words = OPENED[name]
    run, said = play(tmp_path, act, firmware="grblHAL")
    assert words in said
    assert "motion: nothing was moved" in said
    assert run.end - run.begin < (6.0 if name == SINCE_LONG else 2.0)


LOCKED = {
    "a homing that is required, said at the start": lambda w: w.controller.inject_wire(
        to_host=first_report("ALARM:11\r\n[MSG:Homing cycle required]")
    ),
    "a hard limit that lets it obey nothing before a reset": lambda w: w.controller.inject_alarm(1),
    "a hard limit, no line is answered before a reset": obeys_after_reset,
}


@pytest.mark.parametrize("name", LOCKED)
def test_a_locked_controller_is_homed_once_a_person_has_said_that_the_tip_is_free(tmp_path, name):
    made = World(5, tmp_path / "session", presses=1, firmware="grblHAL")
    made.controller.machine.alarm = 0
    LOCKED[name](made)
    made.answer = lambda question: True
    made.schedule.run_for(0.3, made.bench)
    try:
        with pytest.raises(DeviceError, match="outside the envelope"):  # where homing ends
            made.record(home=True)
    finally:
        made.end()
    assert "about to home" in made.asked[0], "it says another place than one that was just switched on"
    assert made.controller.machine.alarm is None
    np.testing.assert_allclose(made.position(), [-1, -1, -1], atol=0.01)


@pytest.mark.parametrize("word", ["M3", "M4", "G20", "G93", "G91", "G92X1Y2Z3"])
def test_a_state_that_spoils_moves_is_ended_before_the_first(tmp_path, word):
    made = World(5, tmp_path / "session", presses=1)
    other_program(f"{word}\n".encode())(made)
    made.schedule.run_for(0.2, made.bench)
    modal = made.controller.machine.modal
    assert word[:3] == "G92" or word in modal.said.split()
    try:
        assert len(made.record().done) == 1
    finally:
        made.end()
    assert word not in made.controller.machine.modal.said.split()
    assert not made.controller.machine.modal.shift.any()


@pytest.mark.parametrize("at", [0.6, 7.2])
def test_a_move_that_grblhal_cut_short_without_a_word_is_noticed(tmp_path, at):
    """Its stop (0x19) answers the waiting line with ok, as if the move had ended, and says Idle."""
    run, words = play(tmp_path, lambda w: w.controller.inject_stop(), at, firmware="grblHAL")
    assert "which an answer said had ended" in str(run.error)
    assert "0x19" in words
    assert "lifted off the skin" in words or "stands clear of the skin" in words
    assert run.here[2] > ORIGIN[2]


def test_two_controllers_on_one_line_leave_no_known_place(tmp_path):
    other = reports(lambda text: f"{text}\r\n" + re.sub("MPos:[^|>]*", "MPos:-1.000,-1.000,-1.000", text))
    run, words = play(tmp_path, wire(other), HOLDING)
    assert "the guide cannot be where a report says" in str(run.error)
    assert "farther than it can have moved" in words
    assert "zero:   LOST" in words
    assert "clear of the skin" not in words


def test_a_receive_buffer_that_takes_no_line_is_refused_before_anything_moves(tmp_path):
    _, words = play(tmp_path, wire(lambda text: re.sub(r"^(\[OPT:\w+,\d+),\d+", r"\1,20", text)))
    assert "states a receive buffer of 20 bytes" in words
    assert "motion: nothing was moved" in words
