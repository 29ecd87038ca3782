"""The emulated firmware answers as Grbl 1.1h does, byte by byte as a terminal would see it.

The answers were taken down from Grbl 1.1h built for a host. With ``TACDATA_GRBL_FIRMWARE`` that names such a program
(docs/how_to/testing_with_firmware.md) each play runs against it, too.
"""

import os
import pty
import re
import select
import shlex
import subprocess
import time
import tty

import pytest
import serial

from tacdata.clock import Clock
from tacdata.virtual_rig.firmware.controller import Controller

COMMAND = os.environ.get("TACDATA_GRBL_FIRMWARE", "")
SETTINGS = {
    "$1": "255",
    "$10": "1",
    "$20": "0",
    "$22": "0",
    "$100": "250.000",
    "$101": "250.000",
    "$102": "250.000",
    "$110": "3000.000",
    "$111": "3000.000",
    "$112": "900.000",
    "$120": "200.000",
    "$121": "200.000",
    "$122": "150.000",
}
WELCOME, LOCKED = "Grbl 1.1h ['$' for help]", "[MSG:'$H'|'$X' to unlock]"
MODES = "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]"
PLAYS = {
    # Bytes that are sent, and pauses in s; what comes back, without settings, of reports the state alone.
    "a reset in a pause, whose line is answered": (("G4P2\n", 0.3, "\x18", 0.4), ["ok", WELCOME]),
    "a reset in motion, with a line that waits for its end": (
        ("G1X-10F600\nG4P1\n", 0.4, "\x18", 1.3),
        ["ok", "ALARM:3", "ok", WELCOME, LOCKED],
    ),
    "a hold, then a reset": (
        ("G1X-10F600\nG4P1\n", 0.3, "!", 0.5, "?", 0.1, "\x18", 0.4, "?", 0.1),
        ["ok", "<Hold:0>", "ok", WELCOME, "<Idle>"],
    ),
    "check mode, left by a reset": (
        ("$C\n", 0.1, "?", 0.1, "$#\n", 0.1, "$N\n", 0.1, "$110=3000\n", 0.1, "$G\n", 0.1, "$C\n", 0.4, "?", 0.1),
        [
            "[MSG:Enabled]",
            "ok",
            "<Check>",
            "error:8",
            "error:8",
            "error:8",
            MODES,
            "ok",
            "[MSG:Disabled]",
            "ok",
            WELCOME,
            "<Idle>",
        ],
    ),
    "sleep, after which it is locked": (
        ("$SLP\n", 0.3, "?", 0.1, "\x18", 0.4, "?", 0.1),
        ["ok", "[MSG:Sleeping]", "<Sleep>", WELCOME, LOCKED, "<Alarm>"],
    ),
    "lines in a jog": (
        ("$J=G91X-5F300\n", 0.2, "G1X1F10\n", 0.1, "$$\n", 0.4, "$#\n", 0.1, "\x85", 0.4, "?", 0.1),
        ["ok", "error:9", "ok", "error:8", "<Idle>"],
    ),
    "a door in a jog, which is not taken up again": (
        ("$J=G91X-5F300\n", 0.2, "\x84", 0.5, "?", 0.1, "~", 0.3, "?", 0.1),
        ["ok", "[MSG:Check Door]", "<Door:0>", "<Idle>"],
    ),
    "a target beyond the soft limits": (
        ("$22=1\n", 0.3, "$20=1\n", 0.3, "G1X300F600\n", 1.0, "?", 0.1, "\x18", 0.5, "?", 0.1, "$X\n", 0.2),
        [
            "ok",
            "ok",
            "ALARM:2",
            "[MSG:Reset to continue]",
            "ok",
            WELCOME,
            LOCKED,
            "<Alarm>",
            "[MSG:Caution: Unlocked]",
            "ok",
        ],
    ),
    "bytes that are left out of a line": (("\x01G21\n", 0.1, "/G21\n", 0.1, "%\n", 0.1), ["ok", "ok", "error:1"]),
    "a tool's length, which the modes do not name": (("G43.1Z1.5\n", 0.1, "$G\n", 0.1), ["ok", MODES, "ok"]),
}


def play(line, steps):
    """Send the bytes with their pauses; return what came back, as text."""
    heard = b""
    for step in steps:
        if isinstance(step, str):
            os.write(line, step.encode("latin-1"))
            continue
        end = time.monotonic() + step
        while (left := end - time.monotonic()) > 0:
            if select.select([line], [], [], left)[0]:
                heard += os.read(line, 4096)
    return heard.decode("latin-1")


def lines_of(heard):
    """Return the lines that came back, as `PLAYS` writes them."""
    lines = [re.sub(r"^<([^|]*).*", r"<\1>", line.strip("\r\x00")) for line in heard.split("\n")]
    return [line for line in lines if line and not re.match(r"\$\d", line)]


@pytest.fixture
def emulated():
    controller = Controller(Clock.start(), settings=SETTINGS, position=(0.0, 0.0, 0.0))
    controller.start()
    with serial.Serial(controller.port.path, 115200, timeout=0) as line:
        play(line.fileno(), (0.2, "\x18", 0.3, "?", 0.1))
        yield line.fileno()
    controller.stop()


@pytest.fixture
def real(tmp_path):
    line, child = pty.openpty()
    tty.setraw(child)
    process = subprocess.Popen(shlex.split(COMMAND), stdin=child, stdout=child, cwd=tmp_path)
    os.close(child)
    settings = [step for name, value in SETTINGS.items() for step in (f"{name}={value}\n", 0.15)]
    play(line, (2.0, "\n$I\n", 0.5, *settings, "\x18", 0.4, "?", 0.1))
    yield line
    process.kill()
    process.wait()
    os.close(line)


FIRMWARES = ["emulated", pytest.param("real", marks=pytest.mark.skipif(not COMMAND, reason="no firmware is named"))]


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("name", PLAYS)
def test_the_same_bytes_get_the_same_answers(request, firmware, name):
    steps, answers = PLAYS[name]
    assert lines_of(play(request.getfixturevalue(firmware), steps)) == answers


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_hold_brakes_only_after_the_steps_that_are_cut_already(request, firmware):
    line = request.getfixturevalue(firmware)
    heard = play(line, ("G1X-20F600\n", 0.6, "?", 0.02, "!", 0.6, "?", 0.1))
    before, after = (float(x) for x in re.findall(r"MPos:(-?[\d.]+)", heard))
    braking = 10.0**2 / (2 * 200)
    assert 0.4 < before - after - braking < 0.9, "10 mm/s for 45 ms, and for the 20 ms between the report and the hold"
