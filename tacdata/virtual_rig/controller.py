"""An emulated GRBL 1.1 motion controller on a virtual port."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from tacdata.clock import Clock
from tacdata.virtual_rig import gcode, grbl_texts
from tacdata.virtual_rig.grbl_texts import PLANNER_BLOCKS, RX_BYTES, WELCOME, axis_setting
from tacdata.virtual_rig.planner import Block, Planner, axis_limit
from tacdata.virtual_rig.port import VirtualPort

REALTIME = b"?!~\x18\x85"
BYTE_SECONDS = 10 / 115200
NS = 1_000_000_000


class Controller:
    """The firmware's main loop in a thread, on the time of ``clock``.

    `position_at` is where the machine really is; what it reports can differ from that after a loss of
    position.
    """

    def __init__(
        self, clock: Clock, seed: int = 0, position: tuple[float, float, float] = (-1.0, -1.0, -1.0),
        homed: bool = True, settings: dict[str, str] | None = None,
        offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:  # fmt: skip
        """Switch on a machine that stands at ``position`` [mm, machine]; ``offset`` is its G54 [mm]."""
        self.clock = clock
        self.port = VirtualPort(115200, seed)
        self.settings = {**grbl_texts.DEFAULTS, **(settings or {})}
        self.planner = Planner(np.array(position))
        self.modal = gcode.Modal()
        self.offset = np.array(offset, dtype=float)
        self.alarm = not homed  # locked until $H or $X
        self._error = np.zeros(3)  # true minus reported position [mm]
        self._rng = np.random.default_rng(seed)
        self._critical = self._muted = self._check = False
        self._lines: deque[str] = deque()
        self._received = bytearray()
        self._out: deque[tuple[int, str]] = deque()
        self._report_ns: int | None = None
        self._dwell_ns: int | None = None
        self._homing = self._limit_hit = False
        self._reports = 0
        self._faults: queue.SimpleQueue[Callable[[int], None]] = queue.SimpleQueue()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual-grbl", daemon=True)

    def start(self) -> None:
        """Switch on."""
        self._say(self.clock.now_ns(), WELCOME)
        self._thread.start()

    def stop(self) -> None:
        """Switch off and unplug."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self.port.close()

    def position_at(self, time_ns: int) -> np.ndarray:
        """Return the true position of the carriage [mm], shape (3,), at a time of the recent past [ns]."""
        return self.planner.position(time_ns)

    def inject_alarm(self, code: int = 1) -> None:
        """Fault: a limit switch closes (1) or another alarm that stops the machine dead."""
        self._faults.put(lambda now: self._stop_dead(now, code))

    def inject_brown_out(self) -> None:
        """Fault: the supply sags; the firmware starts anew and believes to stand at zero."""
        self._faults.put(self._brown_out)

    def inject_silence(self) -> None:
        """Fault: nothing is answered any more."""
        self._faults.put(lambda now: setattr(self, "_muted", True))

    def inject_bytes(self, data: bytes) -> None:
        """Fault: bytes appear on the line."""
        self._faults.put(lambda now: self.port.write(data))

    def unplug(self) -> None:
        """Fault: the cable is pulled."""
        self._faults.put(lambda now: self.port.close())

    def _run(self) -> None:
        while not self._stopped.is_set():
            data = self.port.read(self._pause())
            now = self.clock.now_ns()
            while not self._faults.empty():
                self._faults.get()(now)
            for byte in data:
                self._take(byte, now)
            self._serve_motion(now)
            self._serve_lines(now)
            self._serve_output(self.clock.now_ns())

    def _pause(self) -> float:
        """Return how long nothing will happen unless a byte comes [s, real time]."""
        due = [t for t in (self._report_ns, self._dwell_ns) if t is not None]
        if self._out:
            due.append(self._out[0][0])
        if (self._lines or self._homing or self._limit_hit) and (end := self.planner.next_end()) is not None:
            due.append(end)
        if not due:
            return 0.02
        return min(max((min(due) - self.clock.now_ns()) / NS / self.clock.rate, 0.0002), 0.02)

    def _take(self, byte: int, now: int) -> None:
        if byte in REALTIME:
            self._realtime(bytes([byte]), now)
        elif self._critical:
            return
        elif len(self._received) + sum(len(line) + 1 for line in self._lines) >= RX_BYTES - 1:
            return  # what does not fit is lost, as in the firmware's ring buffer
        elif byte == 0x0A:
            self._lines.append(self._received.decode("ascii", "replace"))
            self._received.clear()
        elif byte != 0x0D:
            self._received.append(byte)

    def _realtime(self, byte: bytes, now: int) -> None:
        if byte == b"?":
            if self._report_ns is None and not self._critical:
                lag = (
                    self._rng.uniform(0.001, 0.014)
                    if self._dwell_ns is None
                    else self._rng.uniform(0.001, 0.05)
                )
                self._report_ns = now + int(lag * NS)
        elif byte == b"\x18":
            self._reset(now)
        elif byte == b"!" and not self.alarm:
            self.planner.hold(now)
            if self._state(now) == "Jog":
                self._cancel_jog(now)
        elif byte == b"~" and self.planner.held and not self.planner.moving(now):
            self.planner.resume(now)
        elif byte == b"\x85" and self._state(now) == "Jog":
            self._cancel_jog(now)

    def _cancel_jog(self, now: int) -> None:
        # The firmware brakes and then flushes; the braking of a jog is short and left out.
        self.planner.stop(now)

    def _serve_motion(self, now: int) -> None:
        left = self.planner.retire(now)
        if self._homing and not left:
            self._homing, self.alarm, self._error = False, False, np.zeros(3)
            self._say(now, "ok")
        if self._limit_hit and not self.planner.moving(now):
            self._limit_hit = False
            self._stop_dead(now, 2)
        if self._dwell_ns is not None and now >= self._dwell_ns:
            self._dwell_ns = None
            self._say(now, "ok")

    def _serve_lines(self, now: int) -> None:
        while self._lines and self._dwell_ns is None and not self._homing and not self._limit_hit:
            line = self._lines[0].strip()
            if not self._admits(line, now):
                return
            self._lines.popleft()
            try:
                if not line:
                    self._say(now, "ok")
                elif line.startswith("$"):
                    self._dollar(line.upper(), now)
                else:
                    self._gcode(line, now)
            except gcode.Refused as refusal:
                self._say(now, f"error:{refusal.code}")

    def _admits(self, line: str, now: int) -> bool:
        """Whether the planner is ready for a line: empty for a dwell, with a free block for a move."""
        left = self.planner.retire(now)
        waits = "G4P" in line.upper().replace(" ", "")
        return (
            (left == 0 and not self.planner.held) if waits else left < PLANNER_BLOCKS or line.startswith("$")
        )

    def _serve_output(self, now: int) -> None:
        if self._report_ns is not None and now >= self._report_ns:
            text = self._report(self._report_ns)
            silent = self._homing or self._critical
            self._report_ns = None
            if not silent:
                self._say(now, text, lag=0.0)
        if self.port.waiting:
            self.port.write(b"")
        while self._out and self._out[0][0] <= now:
            text = self._out.popleft()[1]
            if not self._muted:
                self.port.write(text.encode("ascii") + b"\r\n")

    def _say(self, now: int, text: str, lag: float | None = None) -> None:
        lag = self._rng.uniform(0.001, 0.003) if lag is None else lag
        due = now + int((lag + len(text) * BYTE_SECONDS) * NS)
        self._out.append((max(due, self._out[-1][0]) if self._out else due, text))

    def _gcode(self, line: str, now: int) -> None:
        if self.alarm:
            raise gcode.Refused(9)
        position = self.planner.target - self._error
        action = gcode.interpret(line, self.modal, position, self.offset)
        if action.dwell is not None and not self._check:
            self._dwell_ns = now + int(action.dwell * NS)
        elif action.target is not None and not self._check:
            if self._outside(action.target):
                self.planner.hold(now)
                self._limit_hit = True
                return
            self._move(action.target, None if action.rapid else self.modal.feed / 60, now, "Run")
            self._say(now, "ok")
        else:
            self._say(now, "ok")

    def _move(self, target: np.ndarray, speed: float | None, now: int, kind: str) -> None:
        start = self.planner.target
        end = np.round((target + self._error) * axis_setting(self.settings, "$10")) / axis_setting(
            self.settings, "$10"
        )
        length = float(np.linalg.norm(end - start))
        if length == 0:
            return
        unit = (end - start) / length
        fastest = axis_limit(unit, axis_setting(self.settings, "$11") / 60)
        speed = fastest if speed is None else min(speed, fastest)
        self.planner.add(
            Block(start, end, speed, axis_limit(unit, axis_setting(self.settings, "$12")), kind), now
        )

    def _outside(self, target: np.ndarray) -> bool:
        return self.settings["$20"] == "1" and bool(
            np.any(target > 0) or np.any(target < -axis_setting(self.settings, "$13"))
        )

    def _dollar(self, line: str, now: int) -> None:
        busy = self._state(now).split(":")[0] not in ("Idle", "Alarm", "Check")
        if line.startswith("$J="):
            self._jog(line[3:], now)
        elif line == "$G":
            words = " ".join(self.modal.words.values())
            self._answer(now, [f"[GC:{words} T0 F{self.modal.feed:g} S0]"])
        elif line in ("$", "$$", "$#", "$I", "$N", "$C", "$H", "$X") or "=" in line:
            if busy:
                raise gcode.Refused(8)
            self._idle_command(line, now)
        else:
            raise gcode.Refused(3)

    def _idle_command(self, line: str, now: int) -> None:
        if (lines := grbl_texts.information(line, self.settings, self.offset)) is not None:
            self._answer(now, lines)
        elif line == "$X":
            self._answer(now, ["[MSG:Caution: Unlocked]"] if self.alarm else [])
            self.alarm = False
        elif line == "$C":
            self._check = not self._check
            self._answer(now, [f"[MSG:{'Enabled' if self._check else 'Disabled'}]"])
        elif line == "$H":
            self._home(now)
        else:
            self._set(line, now)

    def _answer(self, now: int, lines: list[str]) -> None:
        for text in [*lines, "ok"]:
            self._say(now, text)

    def _set(self, line: str, now: int) -> None:
        name, _, value = line.partition("=")
        if name not in self.settings:
            raise gcode.Refused(3)
        try:
            if float(value) < 0:
                raise gcode.Refused(4)
        except ValueError:
            raise gcode.Refused(2) from None
        if (name, value) == ("$20", "1") and self.settings["$22"] != "1":
            raise gcode.Refused(10)
        self.settings[name] = value
        self._say(now, "ok")

    def _home(self, now: int) -> None:
        if self.settings["$22"] != "1":
            raise gcode.Refused(5)
        self._homing, self._error = True, np.zeros(3)
        self._move(np.full(3, -float(self.settings["$27"])), float(self.settings["$25"]) / 60, now, "Home")

    def _jog(self, line: str, now: int) -> None:
        if self.alarm:
            raise gcode.Refused(9)
        if self._state(now) not in ("Idle", "Jog"):
            raise gcode.Refused(8)
        scratch = gcode.Modal(dict(self.modal.words), 0.0)
        action = gcode.interpret(line, scratch, self.planner.target - self._error, self.offset, jog=True)
        if action.target is None:
            raise gcode.Refused(16)
        if self._outside(action.target):
            raise gcode.Refused(15)
        words = dict(gcode.split(line))
        unit = 25.4 if "G20" in line or (self.modal.unit != 1.0 and "G21" not in line) else 1.0
        self._move(action.target, words["F"] * unit / 60, now, "Jog")
        self._say(now, "ok")

    def _state(self, now: int) -> str:
        if self._homing:
            return "Home"
        if self.alarm or self._critical:
            return "Alarm"
        if self._check:
            return "Check"
        moving = self.planner.moving(now)
        if self.planner.held:
            return "Hold:1" if moving else "Hold:0"
        if not moving:
            return "Idle"
        return self.planner.blocks[0].kind if self.planner.blocks else "Run"

    def _report(self, now: int) -> str:
        moving, waiting = (
            self.planner.moving(now),
            len(self._received) + sum(len(line) + 1 for line in self._lines),
        )
        free = (PLANNER_BLOCKS - self.planner.retire(now), RX_BYTES - waiting)
        believed = self.planner.position(now) - self._error
        self._reports += 1
        return grbl_texts.report(
            self.settings,
            self._state(now),
            believed,
            self.planner.speed(now),
            self.offset,
            free,
            self._reports - 1,
            moving,
        )

    def _clear(self) -> None:
        self._lines.clear()
        self._received.clear()
        self._out.clear()
        self._report_ns = self._dwell_ns = None
        self._homing = self._limit_hit = self._critical = self._check = False
        self._reports = 0
        self.modal = gcode.Modal()

    def _reset(self, now: int) -> None:
        moving, homing = self.planner.stop(now), self._homing
        self._clear()
        if moving:  # the steppers are cut off in motion: steps are lost
            self._error += self._rng.normal(0, 0.02, 3)
            self.alarm = True
            self._say(now, f"ALARM:{6 if homing else 3}")
        self._say(now, "")
        self._say(now, WELCOME, lag=0.02)
        if self.alarm:
            self._say(now, "[MSG:'$H'|'$X' to unlock]")

    def _stop_dead(self, now: int, code: int) -> None:
        if self.planner.stop(now):
            self._error += self._rng.normal(0, 0.02, 3)
        self._clear()
        self.alarm = True
        self._critical = code in (1, 2)  # then only a reset is heard
        self._say(now, f"ALARM:{code}")
        self._say(now, "[MSG:Reset to continue]")

    def _brown_out(self, now: int) -> None:
        self.planner.stop(now)
        self._clear()
        self._error = self.planner.position(now)
        self.alarm = self.settings["$22"] == "1"
        self._say(now, "\x00" + WELCOME, lag=0.05)
        if self.alarm:
            self._say(now, "[MSG:'$H'|'$X' to unlock]")
