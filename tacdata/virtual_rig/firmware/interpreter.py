"""Lines of the emulated firmware: G-code, and the ``$`` commands of Grbl's `system.c`."""

from __future__ import annotations

import numpy as np

from tacdata.virtual_rig.firmware import gcode, texts
from tacdata.virtual_rig.firmware.machine import Machine


class Interpreter(Machine):
    """The machine with its main loop's work: one line in, one answer out."""

    def execute(self, line: str, now_ns: int) -> None:
        """Carry out a line and send its answer."""
        try:
            if len(line) > self.firmware.line_bytes:
                raise gcode.Refused(11)
            if line.startswith("$"):
                self._dollar(line.upper(), now_ns)
            elif line:
                self._gcode(line, now_ns)
            else:
                self._say(now_ns, "ok")
            self._refused = 0
        except gcode.Refused as refusal:
            self._refused = refusal.code if self.firmware.refuses_after_error else 0
            self._say(now_ns, f"error:{refusal.code}")

    def _gcode(self, line: str, now_ns: int) -> None:
        if self.alarm is not None or self.state(now_ns) == "Jog":
            raise gcode.Refused(9)
        if self._refused:
            raise gcode.Refused(self._refused)
        if self._act(line, now_ns):
            self._say(now_ns, "ok")

    def _dollar(self, line: str, now_ns: int) -> None:
        state = self.state(now_ns).split(":")[0]
        # After a limit alarm grblHAL answers these questions, and refuses all else until a reset.
        if self.critical and line not in ("$G", "$#", "$$", "$I", "$N"):
            raise gcode.Refused(79)
        if line.startswith("$J="):
            self._jog(line[3:], now_ns)
        elif line == "$G":
            modes = self.modal.said if self.firmware.names_length else self.modal.said.replace(" G43.1", "")
            self._answer(now_ns, [f"[GC:{modes} T0 F{self.modal.feed:g} S0]"])
        elif line in ("$", "$$", "$#", "$I", "$N", "$C", "$H", "$X", "$SLP") or "=" in line:
            if state not in self._states_for(line):
                raise gcode.Refused(8)
            self._idle_command(line, now_ns)
        else:
            raise gcode.Refused(3)

    def _states_for(self, line: str) -> tuple[str, ...]:
        """Return the states in which a ``$`` command is carried out."""
        if line in ("$C", "$") or not self.firmware.asks_only_at_rest:
            return "Idle", "Alarm", "Check"
        return ("Idle", "Alarm", "Check", "Jog", "Door") if line in ("$$", "$X") else ("Idle", "Alarm")

    def _idle_command(self, line: str, now_ns: int) -> None:
        bent = self.modal.shift, self.modal.length
        reply = texts.information(line, self.firmware, self.settings, self.offset, self.startup, *bent)
        if reply is not None:
            self._answer(now_ns, ["error:7"] if line == "$#" and self.unreadable else reply)
        elif line == "$X":
            self._answer(now_ns, ["[MSG:Caution: Unlocked]"] if self.alarm is not None else [])
            self.alarm = None
        elif line == "$C":
            self._turn_check_mode(now_ns)
        elif line == "$SLP":
            self.sleeping = True
            self._answer(now_ns, [])
            self._say(now_ns, "[MSG:Sleeping]")
        elif line == "$H":
            self._home(now_ns)
        elif line.startswith("$N"):
            self._keep(line, now_ns)
        else:
            self._set(line, now_ns)

    def _turn_check_mode(self, now_ns: int) -> None:
        """Switch it on, or off; the checked lines have changed the modal state, so leaving it is a reset."""
        if self.alarm is not None:
            raise gcode.Refused(8)
        self.check = not self.check
        self._answer(now_ns, [f"[MSG:{'Enabled' if self.check else 'Disabled'}]"])
        if not self.check:
            self.reset(now_ns)

    def _answer(self, now_ns: int, lines: list[str]) -> None:
        for text in [*lines, "ok"]:
            self._say(now_ns, text)

    def _keep(self, line: str, now_ns: int) -> None:
        number, _, text = line[2:].partition("=")
        if number not in ("0", "1"):
            raise gcode.Refused(3)
        # A start-up line is carried out when it is stored: one that is refused is not kept.
        if text:
            self._act(text, now_ns)
        self.startup[int(number)] = text
        self._say(now_ns, "ok")

    def _set(self, line: str, now_ns: int) -> None:
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
        self._say(now_ns, "ok")

    def _home(self, now_ns: int) -> None:
        if not int(self.settings["$22"]) & 1:
            raise gcode.Refused(5)
        self.homing, self.error = True, np.zeros(3)
        self._move(np.full(3, -float(self.settings["$27"])), float(self.settings["$25"]) / 60, now_ns, "Home")

    def _jog(self, line: str, now_ns: int) -> None:
        if self.alarm is not None:
            raise gcode.Refused(9)
        if self.state(now_ns) not in ("Idle", "Jog"):
            raise gcode.Refused(8)
        # A jog leaves the modal state as it was.
        scratch = gcode.Modal(dict(self.modal.words), 0.0)
        action = gcode.interpret(line, scratch, self.planner.target - self.error, self.offset, jog=True)
        if action.target is None:
            raise gcode.Refused(16)
        if self._outside(action.target):
            raise gcode.Refused(15)
        words = dict(gcode.split(line))
        unit = 25.4 if "G20" in line or (self.modal.unit != 1.0 and "G21" not in line) else 1.0
        self._move(action.target, words["F"] * unit / 60, now_ns, "Jog")
        self._say(now_ns, "ok")
