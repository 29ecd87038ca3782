"""Opens the conversation: makes sure that the controller is at rest and obeys, without moving it."""

from __future__ import annotations

import numpy as np

from tacdata.errors import DeviceError
from tacdata.wire.delivered import OwesAnswer
from tacdata.wire.grbl import codes
from tacdata.wire.grbl.lines import OPENED_AGAIN, WELCOME
from tacdata.wire.grbl.link import GrblLink
from tacdata.wire.grbl.settings import STATE, UNDONE_BY, GrblSettings

GREETING = 15.0
"""Timeout for the first answer [s, real time]: a boot loader takes 1-2 s, a simulated board more."""
GARBAGE = 4.0
"""The same if the bytes received are no text, as with another baud rate [s, real time]."""
FIRST_QUERY = 0.25
"""Interval between queries while nothing is received [s, real time]."""
ANSWER = 10.0
"""Timeout for the answer to a ``$`` command or a reset [s of the clock]; an alarm alone takes Grbl 0.5 s."""
ATTEMPTS, SETTLE, LOOK = 3, 0.5, 0.02
"""Questions for the version [count], the pause after one in which late answers come, and its part after which they are
looked at [s, real time]."""
RESETS = 4
"""Attempts to reset a controller within `ANSWER` [count]: one byte may be lost on its way, or its welcome damaged."""
TALKS = ("Idle", "Alarm")
"""States in which ``$`` commands are answered."""
TELL_ALL = b"\x87"
"""grblHAL's query for a report with all fields: the alarm's number, and whether it was homed. FluidNC runs a macro at
it.
"""
FULL_SPEED = (b"\x90", b"\x95")
"""Set feed and rapid override back to 100 %; moves nothing."""
REMEDIES = {
    "Run": "let it finish or stop it, then try again",
    "Jog": "let it finish or stop it, then try again",
    "Home": "wait until homing has ended, then try again",
    "Hold": "wait until the hold has ended, then try again",
    "Door": "close the safety door, then try again",
    "Check": "switch check mode off ($C) in a terminal, then try again",
    "Sleep": "wake it with a reset and home it, as its motors were off",
    "Tool": "finish the tool change, then try again",
}


def greet(link: GrblLink, baud: int) -> None:
    """Wait for a welcome (the board was reset) or an answer to ``?`` (it was not).

    Nothing but queries is sent, since the machine may be moving.

    Raises:
        DeviceError: If nothing speaks GRBL 1.1.
    """
    for turn in range(int(GREETING / FIRST_QUERY)):
        # Bytes beyond ASCII come at another baud rate, which waiting does not change.
        if turn * FIRST_QUERY >= GARBAGE and not bytes(link.seen).isascii():
            break
        if link.hear(FIRST_QUERY):
            link.check()
            _refuse_old(link)
            return
        link.ask()
    raise _silent(link, baud)


def _place(link: GrblLink) -> None:
    """Ask for the offset of work positions, where the reports never contain it (grblHAL with ``$10=0``)."""
    if link.statuses.unplaced:
        link.statuses.place(GrblSettings.read(link, ANSWER, STATE).work_offset)
        if link.statuses.unplaced:
            raise DeviceError(
                f"the controller on {link.port.port} reports work positions and does not say their offset",
                "machine positions, or work positions with WCO",
                "set $10=1 (machine positions) in a terminal",
            )


def straighten(link: GrblLink) -> tuple[str, ...]:
    """End everything that changes coordinates (scaling, rotation, G92, tool length, inches); return the changes, as
    text.

    Raises:
        DeviceError: If it cannot be ended.
    """
    settings = GrblSettings.read(link, ANSWER, STATE)
    bent = settings.bent_by
    for word in dict.fromkeys(UNDONE_BY[change][0] for change in bent):
        link.command(word, ANSWER)
    # Read again: whether the controller obeyed is seen only in its state.
    settings = GrblSettings.read(link, ANSWER, STATE) if bent else settings
    link.statuses.place(settings.work_offset)
    if residue := settings.bent_by:
        raise DeviceError(
            f"the controller on {link.port.port} does not leave a state that spoils every move: {_named(residue)}",
            "machine coordinates as they are, and a spindle at rest",
            "end it in a terminal; see its start-up lines ($N) and macros",
        )
    return tuple(f"{_named((word,))} was active and was ended ({UNDONE_BY[word][0]})" for word in bent)


def _named(words: tuple[str, ...]) -> str:
    return ", ".join(f"{word} ({UNDONE_BY[word][1]})" for word in words)


def clear(link: GrblLink) -> str:
    """End a hold at rest, or an alarm that hears no line (nothing moves); return the state that was found.

    Raises:
        DeviceError: If the machine is moving, or in another state that only a person should end.
    """
    initial = _state(link)
    # Only at rest: a reset while motors run loses steps, and with them the position.
    if initial in OPENED_AGAIN or (initial.startswith("Alarm") and link.alarm in codes.DEAF):
        reset(link)
    state = _state(link)
    if link.pendant:
        raise DeviceError(
            f"a pendant has control of the controller on {link.port.port} (MPG:1): lines from here are ignored",
            "one master",
            "give control back at the pendant, then try again",
        )
    if state.split(":")[0] not in TALKS:
        raise DeviceError(
            f"the controller on {link.port.port} is in state {state}",
            "Idle",
            REMEDIES.get(state.split(":")[0], "bring it to Idle, then try again"),
        )
    attune(link)
    _place(link)
    # Overrides outlive programs: moves would take longer than planned.
    for override in FULL_SPEED:
        link.realtime(override)
    return initial


def attune(link: GrblLink) -> None:
    """Ask for the version until question and answer belong together.

    A program that ended may have left half a line in the controller's buffer, or answers that are still to come. The
    question makes half a line of motion invalid; ending that line otherwise might carry it out.

    Raises:
        DeviceError: If the question is refused each time.
    """
    unanswered = 0
    for attempt in range(1, ATTEMPTS + 1):
        try:
            if any(line.startswith("[VER:") for line in link.command("$I", ANSWER)[0]):
                return
        except DeviceError as error:
            if link.fault:
                raise
            # An answer of an earlier conversation is consumed by each attempt. A line without any answer is another
            # fault.
            unanswered += isinstance(error, OwesAnswer)
            # Each attempt without an answer costs its whole patience, so two of them are enough.
            if ATTEMPTS in (attempt, unanswered + 1):
                raise DeviceError(
                    f"the controller on {link.port.port} answers ? but no line: {error.given}",
                    "answers to lines, too",
                    "see that no pendant (MPG) and no other program has control of it; reset it if it hangs",
                ) from None
            link.write_off()
            if link.last and link.last.state.startswith("Alarm"):
                reset(link)
                _place(link)
        link.clock.host.sleep(SETTLE)


def ask_all(link: GrblLink, settings: GrblSettings) -> None:
    """Ask a grblHAL for its alarm's number, or whether it was homed. Other reports need not state them."""
    is_locked = bool(link.last and link.last.state.startswith("Alarm"))
    if not settings.is_hal or not (is_locked or settings.homing):
        return
    link.realtime(TELL_ALL)
    for _ in range(round(SETTLE / LOOK)):  # an older firmware states neither
        if (link.alarm if is_locked else link.statuses.homed) is not None:
            return
        link.clock.host.sleep(LOOK)


def unproved(link: GrblLink, settings: GrblSettings) -> str:
    """Return why an unlocked controller's position cannot be trusted, as a sentence; empty without a reason."""
    homed = link.statuses.homed
    if homed or (settings.homing and homed is None):  # a Grbl with homing is locked until it is homed
        return ""
    # Opening a port can pull DTR, which resets many boards: machine zero is then where the tip happened to be.
    if link.resets:
        return "the controller was reset when its port was opened, so it counts from where it stands now"
    # A machine that was moved since is hardly at exactly zero on all axes.
    if link.last is not None and not np.any(link.last.position):
        return "the controller reports exactly (0, 0, 0), as when it is switched on, and it was not homed"
    return ""


def unblock(link: GrblLink) -> None:
    """Reset a controller that obeys no line before. Nothing moves."""
    if link.alarm in codes.DEAF:
        reset(link)
        _place(link)


def _state(link: GrblLink) -> str:
    return link.statuses.unplaced or link.fresh_status(ANSWER).state


def reset(link: GrblLink) -> None:
    """Reset a controller at rest: the queue is emptied, and the position kept.

    Raises:
        DeviceError: On a fault, or if no welcome comes.
    """
    for attempt in range(1, RESETS + 1):
        try:
            # After a repetition an earlier reset may still come, with a welcome of its own.
            link.soft_reset(ANSWER / RESETS, 0.0 if attempt == 1 else SETTLE)
            break
        except DeviceError:
            if link.fault or link.pendant or attempt == RESETS:
                raise


def locked(link: GrblLink, settings: GrblSettings) -> DeviceError:
    """Return the error for a controller in alarm."""
    why = codes.alarm_in_words(link.alarm) if link.alarm else "state Alarm"
    is_kept = link.alarm in codes.POSITION_KEPT
    home = (
        codes.UNLOCK
        if is_kept
        else "home it ($H), or set home: true under cnc in the rig file (every axis moves at opening)"
        if settings.homing
        else "unlock it ($X) in a terminal and touch off again; homing is switched off ($22=0)"
    )
    return DeviceError(
        f"the controller on {link.port.port} is locked ({why})" + ("" if is_kept else ": its position is not known"),
        "a homed controller in state Idle",
        home,
    )


def _refuse_old(link: GrblLink) -> None:
    version = WELCOME.search(link.welcome)
    if version and (int(version[1]), int(version[2])) < (1, 1):
        raise DeviceError(
            f"the controller on {link.port.port} says {link.welcome!r}",
            "Grbl 1.1 or grblHAL, whose reports and codes are known",
            "flash Grbl 1.1h or grblHAL",
        )


def _silent(link: GrblLink, baud: int) -> DeviceError:
    sample = bytes(link.seen)
    return DeviceError(
        f"nothing on {link.port.port} at {baud} baud speaks GRBL: "
        + (f"it sent {len(sample)} bytes or more, beginning {sample[:24].hex(' ')}" if sample else "it sent no byte"),
        "a GRBL 1.1 or grblHAL controller that says its welcome or answers ?",
        "check the baud rate (GRBL: 115200) and that this is the controller's port"
        if sample
        else "check power, cable and port; Grbl says nothing while it homes or after a limit alarm (press its reset); "
        "some boards need dtr: false under cnc",
    )
