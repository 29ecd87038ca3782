"""The emulated firmware as a bare terminal sees it."""

import time

import numpy as np
import pytest
import serial

from tacdata.clock import Clock
from tacdata.virtual_rig.firmware.controller import Controller

START = (-50.0, -50.0, -20.0)


class Terminal:
    """Sends lines and collects what comes back."""

    def __init__(self, controller):
        self.line = serial.Serial(controller.port.path, 115200, timeout=0.02)

    def say(self, data: bytes):
        self.line.write(data)

    def hear(self, ending: str, seconds: float = 30.0) -> list[str]:
        heard, end = b"", time.monotonic() + seconds
        while time.monotonic() < end:
            heard += self.line.read(256)
            lines = heard.decode().splitlines()
            if lines and lines[-1].startswith(ending) and heard.endswith(b"\n"):
                return lines
        raise AssertionError(f"no {ending!r} in {heard!r}")

    def hear_all(self, often: bytes, count: int) -> bytes:
        """Everything that comes until a word came so often, and what comes soon after."""
        heard, end = b"", time.monotonic() + 30
        while heard.count(often) < count and time.monotonic() < end:
            heard += self.line.read(256)
        time.sleep(0.2)
        return heard + self.line.read(4096)

    def watch(self, beginning: str) -> str:
        """Query the state until the answer begins with a word."""
        end = time.monotonic() + 30
        while time.monotonic() < end:
            self.say(b"?")
            if (answer := self.hear("<")[-1]).startswith(beginning):
                return answer
        raise AssertionError(f"no {beginning!r}: {answer}")

    def ask(self, text: str) -> str:
        self.say(text.encode() + b"\n")
        end = time.monotonic() + 30
        while time.monotonic() < end:
            answer = self.line.readline().decode().strip()
            if answer == "ok" or answer.startswith("error"):
                return answer
        raise AssertionError(f"no answer to {text!r}")


@pytest.fixture
def terminal():
    controller = Controller(Clock.start(10.0), seed=1, position=START)
    controller.start()
    terminal = Terminal(controller)
    terminal.controller = controller
    assert terminal.ask("") == "ok"  # the welcome, if it was heard, came before
    yield terminal
    terminal.line.close()
    controller.stop()


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("G1X1", "error:22"),
        ("G2X1Y1I1", "error:20"),
        ("G0G1X1", "error:21"),
        ("G4", "error:28"),
        ("X1X2", "error:25"),
        ("GX", "error:2"),
        ("%", "error:1"),
        ("$Q", "error:3"),
        ("$20=-1", "error:4"),
        ("$110=abc", "error:2"),
        ("$J=X10", "error:22"),
        ("$J=X500F100", "error:15"),
        ("G53 G80 X1", "error:30"),
        ("", "ok"),
        ("(comment) g21 ; tail", "ok"),
        ("G0 X-50.0 Y-50 Z-20", "ok"),
    ],
)
def test_answers(terminal, line, answer):
    assert terminal.ask(line) == answer


def test_modal_words_change_where_it_goes(terminal):
    clock, controller = terminal.controller.clock, terminal.controller
    for line in ("G91", "G0X2", "G20", "G0Y-0.1", "G21G90", "G1Z-21F600", "G4P0.01"):
        assert terminal.ask(line) == "ok"
    np.testing.assert_allclose(controller.position_at(clock.now_ns()), [-48, -52.54, -21], atol=2e-3)


def test_jog_leaves_the_modal_state_alone_and_is_cancelled(terminal):
    assert terminal.ask("$J=G91X20F30") == "ok"
    terminal.say(b"?")
    assert terminal.hear("<")[-1].startswith("<Jog|MPos:")
    terminal.say(b"\x85")
    x = float(terminal.watch("<Idle|MPos:").split(":")[1].split(",")[0])
    assert -50 <= x < -31, "20 mm were asked for"
    terminal.say(b"$G\n")
    assert "G90" in terminal.hear("ok")[0]


def test_reset_in_motion_is_alarm_3_and_locks(terminal):
    terminal.ask("G1X-90F100")
    terminal.say(b"\x18")
    heard = terminal.hear("[MSG:")
    assert heard[0] == "ALARM:3"
    assert "Grbl 1.1h ['$' for help]" in heard
    assert terminal.ask("G0X-50") == "error:9"
    terminal.say(b"$X\n")
    assert terminal.hear("ok")[:1] == ["[MSG:Caution: Unlocked]"]
    assert terminal.ask("G0X-50") == "ok"


def test_reset_at_rest_keeps_the_position(terminal):
    terminal.ask("G0X-45")
    terminal.ask("G4P0.01")
    terminal.say(b"\x18")
    heard = terminal.hear("Grbl")
    assert not any(line.startswith("ALARM") for line in heard)
    terminal.say(b"?")
    assert terminal.hear("<")[-1].startswith("<Idle|MPos:-45.000,-50.000,-20.000")


def test_settings_only_when_idle(terminal):
    terminal.ask("G1X-60F100")
    assert terminal.ask("$$") == "error:8"
    assert terminal.ask("$H") == "error:8"


def test_check_mode_moves_nothing(terminal):
    assert terminal.ask("$C") == "ok"
    assert terminal.ask("G1X-60F6000") == "ok"
    time.sleep(0.1)
    np.testing.assert_allclose(terminal.controller.position_at(terminal.controller.clock.now_ns()), START)


def test_several_queries_collapse_to_one_answer(terminal):
    terminal.say(b"?????")
    assert terminal.hear_all(b"<", 1).count(b"<") == 1


def test_homing_off_is_error_5():
    controller = Controller(Clock.start(10.0), settings={"$22": "0"})
    controller.start()
    terminal = Terminal(controller)
    assert terminal.ask("$H") == "error:5"
    terminal.line.close()
    controller.stop()


def test_burst_beyond_the_buffer_loses_bytes(terminal):
    terminal.say(b"G4P1\n" + b"G1X-50.000Y-50.000F1000\n" * 30)
    answers = terminal.hear_all(b"ok", 2).decode().split()
    assert 1 < len(answers) < 31


def test_a_dwell_is_rounded_up_to_the_firmwares_steps(terminal):
    clock = terminal.controller.clock
    begun = clock.now_ns()
    assert terminal.ask("G4P0.06") == "ok"
    assert (clock.now_ns() - begun) * 1e-9 >= 0.1


def test_carriage_return_and_line_feed_are_two_lines(terminal):
    terminal.say(b"G21\r\n")
    assert terminal.hear_all(b"ok", 2).split() == [b"ok", b"ok"]


@pytest.mark.parametrize(
    ("line", "answer"),
    [("G1X" + "0" * 80, "error:11"), ("N12 G0 X-50", "ok"), ("$N1=G54", "ok"), ("$N3=G54", "error:3")],
)
def test_lines_as_the_firmware_takes_them(terminal, line, answer):
    assert terminal.ask(line) == answer


def test_nothing_is_executed_in_a_hold_and_everything_after_it(terminal):
    terminal.say(b"!")
    time.sleep(0.05)
    terminal.say(b"G0X-49\n?")
    assert terminal.hear("<")[-1].startswith("<Hold:0|MPos:-50.000")
    terminal.say(b"~")
    assert "ok" in terminal.hear("ok")


def test_a_limit_alarm_hears_nothing_but_a_reset(terminal):
    terminal.controller.inject_alarm(1)
    assert terminal.hear("[MSG:")[-2:] == ["ALARM:1", "[MSG:Reset to continue]"]
    time.sleep(0.1)
    terminal.say(b"?$X\n")
    time.sleep(0.2)
    assert terminal.line.read(64) == b""
    terminal.say(b"\x18")
    assert terminal.hear("[MSG:")[-1] == "[MSG:'$H'|'$X' to unlock]"
