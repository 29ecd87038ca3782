"""The state machine of the emulated firmware: effects of lines and real-time bytes, and when they end."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tacdata.virtual_rig.firmware import gcode, texts
from tacdata.virtual_rig.firmware.dialect import Firmware
from tacdata.virtual_rig.firmware.planner import Block, Planner, axis_limit
from tacdata.virtual_rig.firmware.texts import LOCKED, axis_setting

NS = 1_000_000_000
ALWAYS_ON = 255
OVERRIDES = {0x90: None, 0x91: 10, 0x92: -10, 0x93: 1, 0x94: -1}
"""Real-time byte -> change of the feed override [%]; None resets it to 100."""
SOFT_LIMIT = 2
"""Alarm for a target beyond the travel; raised at rest, after a hold (Grbl's `limits_soft_check`)."""
CRITICAL = (1, SOFT_LIMIT)
"""Alarms after which only a reset is accepted."""
LOST = 0.02
"""Steps lost when motors are cut off in motion, standard deviation [mm]."""


class Machine:
    """Grbl 1.1's or grblHAL's behaviour in closed form (`protocol.c`); `serve` brings it to the present time."""

    def __init__(
        self,
        firmware: Firmware,
        settings: dict[str, str],
        position: np.ndarray,
        offset: np.ndarray,
        homed: bool,
        rng: np.random.Generator,
        say: Callable[[int, str], None],
    ) -> None:
        """Stand still at ``position`` [mm, machine]; ``offset`` is the G54 [mm]; ``say`` gets (time [ns], line)."""
        self.firmware, self.settings, self.offset = firmware, settings, offset
        self.planner = Planner(position, firmware.prepared)
        self.startup = ["", ""]
        self.alarm: int | None = None if homed else 0
        self.homed = homed
        self.door_open = False
        self.override = 100
        self.unreadable = self.whole = False
        self.error = np.zeros(3)
        """True minus reported position [mm], shape (3,)."""
        self.reading = False
        """Whether a line was read and waits for motion to end."""
        self.busy_until = 0
        """Until then nothing is executed or reported [ns]: the pause after an alarm."""
        self._dropped = False  # whether a reset ends a line that is still to be answered
        self._say, self._rng = say, rng
        self._boot_due: int | None = None
        self._clear()

    def _clear(self) -> None:
        self.modal = gcode.Modal()
        self.counters = texts.Counters()
        self.dwell_ns: int | None = None
        self.reading = False
        self.homing = self.critical = self.check = self.sleeping = False
        self._door = self._limit_hit = self._jog_cancelled = self._jog_left = False
        self._held_at: int | None = None
        self._refused = 0
        self.override = 100

    def moving(self, now_ns: int) -> bool:
        """Whether it counts as moving: until the motors' idle delay (``$1``) after the last step."""
        delay = int(self.settings["$1"])
        settling = 0 if delay == ALWAYS_ON else delay * 1_000_000
        rest_ns = self.planner.rest_ns
        return self.planner.moving(now_ns) or (rest_ns is not None and rest_ns <= now_ns < rest_ns + settling)

    def state(self, now_ns: int) -> str:
        """Return the state with its substate, as reports write it."""
        if self.homing:
            return "Home"
        if self.alarm is not None:
            named = self.whole or int(self.settings["$10"]) & self.firmware.report_bits["alarm"]
            return f"Alarm:{self.alarm}" if self.alarm and named else "Alarm"
        if self.check:
            return "Check"
        moving = self.moving(now_ns)
        if self._door:
            return "Door:2" if moving else "Door:1" if self.door_open else "Door:0"
        if self._jog_cancelled:
            return "Jog"
        if self.planner.held and (moving or not self._limit_hit):
            return "Hold:1" if moving else "Hold:0"
        if self.sleeping:
            return "Sleep"
        if not moving:
            return "Idle"
        return self.planner.blocks[0].kind if self.planner.blocks else "Run"

    def silent(self, now_ns: int) -> bool:
        """Whether ``?`` gets no answer."""
        deaf = self.critical and not self.firmware.answers_in_critical_alarm
        return self.homing or deaf or now_ns < self.busy_until

    def next_event(self) -> int | None:
        """Return when the next thing ends by itself [ns], as far as it is known."""
        due = [t for t in (self.dwell_ns, self._boot_due) if t is not None]
        if self.busy_until:
            due.append(self.busy_until)
        if (end := self.planner.next_end()) is not None:
            due.append(end)
        return min(due, default=None)

    def serve(self, now_ns: int) -> None:
        """Carry out everything that is due."""
        if self._boot_due is not None and now_ns >= self._boot_due:
            self._boot(now_ns)
        if now_ns < self.busy_until:
            return
        self.busy_until = 0
        backlog = self.planner.retire(now_ns)
        if self.homing and not backlog:
            self.homing, self.homed, self.alarm, self.error = False, True, None, np.zeros(3)
            self._say(now_ns, "ok")
        if (self._jog_cancelled or self._jog_left) and not self.moving(now_ns):
            self._jog_cancelled = self._jog_left = False
            self.planner.stop(now_ns)
        if self._limit_hit and not self.moving(now_ns):
            self._limit_hit = False
            self.stop_dead(now_ns, SOFT_LIMIT)
        if self.dwell_ns is not None and now_ns >= self.dwell_ns and not self._suspended(now_ns):
            self.dwell_ns = None
            self._say(now_ns, "ok")

    def realtime(self, byte: int, now_ns: int) -> None:
        """Process a real-time byte other than ``?`` and 0x18."""
        state = self.state(now_ns).split(":")[0]
        if byte == ord("!") and state in ("Idle", "Run", "Jog"):
            self._hold(now_ns)
            self._jog_cancelled = state == "Jog"
        elif byte == ord("~") and not self.moving(now_ns):
            self._go_on(now_ns)
        elif byte == 0x84:
            self.open_door(now_ns)
        elif byte == 0x85 and state == "Jog":
            self._hold(now_ns)
            self._jog_cancelled = True
        elif byte == self.firmware.stop_byte:
            self._cancel(now_ns)
        elif byte in OVERRIDES:
            change = OVERRIDES[byte]
            new = 100 if change is None else min(max(self.override + change, 10), 200)
            if new != self.override:
                self.planner.scale(new / self.override, now_ns)
                # A counter at zero puts the override into the next report.
                self.override, self.counters.overrides = new, 0

    def open_door(self, now_ns: int) -> None:
        """Open the door, by its switch or by ``0x84``."""
        if self.homing:
            self.stop_dead(now_ns, 7)
            self._boot_due = self.busy_until
        elif self.alarm is None:
            self._say(now_ns, "[MSG:Check Door]")
            self._jog_left = self.state(now_ns) == "Jog"
            self._hold(now_ns)
            self._door = True

    def takes_lines(self, now_ns: int) -> bool:
        """Whether the main loop runs at all: not in a pause, a standing hold, an open door, sleep or homing."""
        deaf = self.critical and not self.firmware.answers_questions_in_critical_alarm
        blocked = self.dwell_ns is not None or self.homing or self._limit_hit or deaf or self.sleeping
        return not blocked and now_ns >= self.busy_until and self._boot_due is None and not self._suspended(now_ns)

    def admits(self, line: str, now_ns: int) -> bool:
        """Whether the planner can take a line: it is empty for a dwell, or has a free block for a move."""
        backlog = self.planner.retire(now_ns)
        if "G4P" in line.upper().replace(" ", ""):
            return not backlog and not self.moving(now_ns) and not self.planner.held
        return line.startswith("$") or backlog < self.firmware.planner_blocks

    def report(self, now_ns: int, rx_free: int) -> str:
        """Return a status report."""
        capacity = self.firmware.planner_blocks - self.planner.retire(now_ns), rx_free
        believed = self.planner.position(now_ns) - self.error
        offset = self.offset + self.modal.shift + (0.0, 0.0, self.modal.length)
        # Asked for once: the alarm's number, and whether it was homed.
        state, whole, self.whole = self.state(now_ns), self.whole, False
        tells_homing = whole and self.firmware.tells_homing and int(self.settings["$22"]) & 1
        return texts.report(
            self.settings,
            self.firmware.report_bits,
            state,
            believed,
            self.planner.speed(now_ns),
            offset,
            capacity,
            self.counters,
            self.override,
            "D" if self.door_open else "",
            self.homed if tells_homing else None,
        )

    def reset(self, now_ns: int) -> None:
        """Process 0x18: in motion the motors are cut off and steps are lost.

        A line that is being carried out is answered with ``ok``, as if it had been.
        """
        moving, homing = self.moving(now_ns), self.homing
        self._drop()
        self.alarm = 0 if self.sleeping and self.alarm is None else self.alarm  # motors were off
        self.planner.stop(now_ns)
        self._clear()
        self.busy_until = 0
        if moving:
            self.error += self._rng.normal(0, LOST, 3)
            self._raise_alarm(6 if homing else 3, now_ns)
            self._boot_due = self.busy_until
        else:
            self._boot(now_ns)

    def brown_out(self, now_ns: int) -> None:
        """Restart, assuming position zero."""
        self.planner.stop(now_ns)
        self._clear()
        self.error = self.planner.position(now_ns)
        self._dropped = False
        self.alarm = 0 if int(self.settings["$22"]) & self.firmware.lock else None
        self.homed = False
        self._say(now_ns, "\x00")
        self._boot(now_ns)

    def stop_dead(self, now_ns: int, code: int) -> None:
        """Cut the motors off and raise an alarm."""
        self._drop()
        if self.planner.stop(now_ns):
            self.error += self._rng.normal(0, LOST, 3)
        self._clear()
        self._raise_alarm(code, now_ns)
        self.critical = code in CRITICAL
        if self.critical:
            self._say(now_ns, "[MSG:Reset to continue]")

    def overtravel(self, now_ns: int) -> None:
        """Brake; at rest the alarm of the soft limits is raised."""
        self._hold(now_ns)
        self._limit_hit = True

    def power_on(self, now_ns: int, fresh: bool) -> None:
        """Send a board's lines at power-on; ``fresh``: with empty memory."""
        if fresh:
            self._say(now_ns, "error:7")
            for line in texts.information("$$", self.firmware, self.settings, self.offset, []) or []:
                self._say(now_ns, line)
        self._boot(now_ns)
        if fresh:
            for _ in self.startup:
                self._say(now_ns, ">:error:7")

    def _suspended(self, now_ns: int) -> bool:
        return (self.planner.held or self._door) and not self.moving(now_ns)

    def _hold(self, now_ns: int) -> None:
        if not self.planner.held:
            self._held_at = now_ns
        self.planner.hold(now_ns)

    def _go_on(self, now_ns: int) -> None:
        if self.alarm is not None or (self._door and self.door_open):
            return
        self._door = False
        if self.dwell_ns is not None and self._held_at is not None:
            # A dwell does not go on during a hold.
            self.dwell_ns += now_ns - self._held_at
        self._held_at = None
        self.planner.resume(now_ns)

    def _cancel(self, now_ns: int) -> None:
        """Process grblHAL's stop: motors halt without braking, every queue is emptied, and it reports Idle."""
        self._drop()
        if self.planner.stop(now_ns):
            self.error += self._rng.normal(0, LOST, 3)
        self._clear()
        if self._dropped:
            self._say(now_ns, "ok")
        self._dropped = False

    def _drop(self) -> None:
        """Let the main loop break off its work; it answers before it begins again."""
        self._dropped |= self.dwell_ns is not None or self.homing or self.reading

    def _raise_alarm(self, code: int, now_ns: int) -> None:
        self.alarm = code
        self._say(now_ns, f"ALARM:{code}")
        self.busy_until = now_ns + int(self.firmware.alarm_pause * NS)

    def _boot(self, now_ns: int) -> None:
        self._boot_due = None
        if self._dropped:
            self._say(now_ns, "ok")
        self._dropped = False
        self._say(now_ns, "")
        self._say(now_ns, self.firmware.welcome)
        if self.alarm is not None:
            self._say(now_ns, LOCKED)
            return
        if self.door_open:
            self.open_door(now_ns)
        for line in self.startup:
            if line:
                try:
                    self._act(line, now_ns)
                    self._say(now_ns, f">{line}:ok")
                except gcode.Refused as refusal:
                    self._say(now_ns, f">{line}:error:{refusal.code}")

    def _act(self, line: str, now_ns: int) -> bool:
        """Carry out G-code; return False if its answer comes later or never."""
        if "G51" in line.upper() and not self.firmware.scales:
            raise gcode.Refused(20)
        action = gcode.interpret(line, self.modal, self.planner.target - self.error, self.offset)
        if action.target is not None and self._outside(action.target):
            self.overtravel(now_ns)
            self.reading = True
            return False
        if self.check:
            return True
        if action.dwell is not None:
            step = self.firmware.dwell_step
            # Rounded first: the last bit of a float must not make whole steps one longer.
            self.dwell_ns = now_ns + int(math.ceil(round(action.dwell / step, 6)) * step * NS)
            return False
        if action.target is not None:
            speed = None if action.rapid else self.modal.feed / 60 * self.override / 100
            self._move(action.target, speed, now_ns, "Run")
        return True

    def _move(self, target: np.ndarray, speed: float | None, now_ns: int, kind: str) -> None:
        start, steps = self.planner.target, axis_setting(self.settings, "$10")
        # Motors make whole steps.
        end = np.round((target + self.error) * steps) / steps
        length = float(np.linalg.norm(end - start))
        if length == 0:
            return
        unit = (end - start) / length
        fastest = axis_limit(unit, axis_setting(self.settings, "$11") / 60)
        # Grbl's lowest feed is 1 mm/min.
        speed = fastest if speed is None else min(max(speed, 1 / 60), fastest)
        self.planner.add(Block(start, end, speed, axis_limit(unit, axis_setting(self.settings, "$12")), kind), now_ns)

    def _outside(self, target: np.ndarray) -> bool:
        return self.settings["$20"] == "1" and bool(
            np.any(target > 0) or np.any(target < -axis_setting(self.settings, "$13"))
        )
