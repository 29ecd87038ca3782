"""Faults that a seed draws: what goes wrong, when, and from when on the recorder can see it."""

import linecache
import random
import re
import signal
import sys

import numpy as np
from schedule import SECOND

LIVED = 3.0
"""Time after which the recorder has seen readings that live [s]."""
SEEN_LIVING = 3.0
"""Time in which a camera of ten images a second shows that its images differ [s]."""
SILENT = 3.0
"""Time after which a silent camera or controller is a fault [s]."""
SILENCE = SILENT + 1.5
"""Time within which the silence of a controller must have ended a run [s]."""
OVERRIDDEN = 6.0
"""Time within which a report must have stated a foreign override [s]: one in 20 states overrides, of 8 a second."""
AT_REST = 1.0
"""Time between two paths of the guide from which it counts as a wait [s]: for a person, the disk, or an opening."""
PRESS_SECONDS = 9.5
"""About how long a press without faults takes [s]."""


class Faults:
    """The faults of one run; `names` says which."""

    def __init__(self, world, seed, only=()):
        """Draw and plan them; ``only`` names kinds to draw from."""
        self.world, self.random = world, random.Random(f"faults {seed}")
        course = PRESS_SECONDS * len(world.plan.presses)
        self.fatal, self.stalls = [], []
        """(time of a fault [s], time [s] within which it must have ended the run if it lasts, who says it)."""
        self.silences = []
        """(begin, end) of times in which no word of the controller arrives [s], as long as they may go unnoticed."""
        self.names, self.visible, self.over = [], [], False
        """(time of a fault [ns], time [ns] after which the recorder can see it, its name)."""
        self.deaf = False
        """Whether the controller may hear nothing, so that nobody can stop it."""
        self.frozen, self.alarmed = False, np.inf
        """Whether the board was frozen, and when an alarm was raised [s]."""
        kinds = only or tuple(KINDS)
        number = self.random.choices((0, 1, 2, 3), (1, 10, 6, 3))[0] if not only else 1
        for _ in range(number):
            name = self.random.choice(kinds)
            self.names.append(name)
            self.at(self.random.uniform(0.0, course), lambda act=ALL[name]: act(self))
        later = random.Random(f"more faults {seed}")  # of its own, so that seeds keep what they drew before
        if not only and later.random() < 0.25:
            name = later.choice(tuple(MORE))
            self.names.append(name)
            self.at(later.uniform(0.0, course), lambda: MORE[name](self))
        latest = random.Random(f"latest faults {seed}")
        if not only and latest.random() < 0.1:
            newest = latest.choice(tuple(LATEST))
            self.names.append(newest)
            self.at(latest.uniform(0.0, course), lambda: LATEST[newest](self))
        last = random.Random(f"newest faults {seed}")
        if not only and last.random() < 0.15:
            kind = last.choice(tuple(NEWEST))
            self.names.append(kind)
            self.at(last.uniform(0.0, course), lambda: NEWEST[kind](self))
        if self.random.random() < 0.3:
            world.computer.lateness = ((0.02, self.random.choice((0.02, 0.1, 0.4))),)
            self.names.append(f"busy computer {world.computer.lateness}")
        world.computer.preempt = self.random.choice((0.0, 0.05, 0.3))

    def at(self, seconds, action):
        """Do something at a time of the world [s]."""
        self.world.schedule.at(round(seconds * SECOND), lambda: self.over or action())

    def after(self, seconds, action):
        """Do something so much later [s]."""
        self.at(self.world.schedule.now + seconds, action)

    def end(self):
        """Let nothing go wrong any more."""
        self.over = True
        for watcher in list(WATCHERS):
            watcher.stop()

    def see(self, name, seconds=0.0):
        """Note that the recorder can see it from now on, or so much later [s]."""
        self.visible.append((self.world.schedule.now_ns, round(seconds * SECOND), name))

    def must_end(self, seconds, words=True):
        """Note that the run must end within so many seconds from now [s], once it is under way.

        ``words``: the controller says it; otherwise this computer sees it.
        """
        if self.world.schedule.now > LIVED:
            self.fatal.append((self.world.schedule.now, seconds, words))

    def silent(self, until=np.inf):
        """Note that no word of the controller arrives until then [s]; the silence itself is noticed."""
        now = self.world.schedule.now
        self.silences.append((now, min(until, now + SILENCE)))

    def stalled(self, seconds):
        """Note a stall of the computer that must end the run if the guide moves."""
        self.stalls.append((self.world.schedule.now, seconds))

    def due(self):
        """Return the first time at which a fault must have ended the run [s]; None on a late computer.

        Waits in which nothing moves do not count: the next path notices it. Time in which this computer does not run
        the thread that hears the controller does not count either. A fault that a controller says cannot be known in
        its silence: a door that opened after it fell mute is noticed as silence (seed 13215).
        """
        computer, drives = self.world.computer, self.world.drives
        if not self.fatal or computer.stalls or computer.lateness:
            return None
        ends, begins = [0.0, *(end for _, end in drives)], [*(begin for begin, _ in drives), np.inf]
        waits = [(end, begin) for end, begin in zip(ends, begins, strict=True) if begin - end > AT_REST]
        waits += [(begin / SECOND, end / SECOND) for begin, end in computer.unheard("grbl-listen")]
        return min(_outside(waits + self.silences * words, at, most) for at, most, words in self.fatal)

    def seen(self, cameras=True):
        """Return when the recorder could first see one of them [s], or None; without ``cameras``, one of the others."""
        computer = self.world.computer
        # Readings and images are evidence by the time in which somebody reads them.
        found = [
            _outside([*computer.stalls, *computer.unheard("taxel-board" if name.startswith("board") else "")], at, most)
            for at, most, name in self.visible
            if cameras or not name.startswith("camera")
        ]
        if computer.disk.refused_ns is not None:
            found.append(computer.disk.refused_ns)
        if not found:
            return None
        first = min(found)
        starved = [(begin, end) for _, begin, end in computer.starved]  # who would see it does not run
        for begin, end in sorted([*computer.stalls, *starved]):
            if begin - SECOND // 2 <= first < end:
                first = end
        for begin, end in sorted(computer.disk.slow):
            if begin - SECOND // 2 <= first < end:
                first = end
        return first / SECOND


WATCHERS = []
"""Who counts lines."""
TOOL = 3
"""The number by which Python knows them."""


class AtALine:
    """Delivers a signal when the main thread has run so many lines of the project.

    Not at the line of a ``with``: it comes again when the block is left, before its end runs. CPython looks for signals
    after calls and jumps back, and never delivers one there. A lock would stay held (seed 5281).
    """

    def __init__(self, faults, number, lines):
        """Begin to count."""
        self.faults, self.number, self.left = faults, number, lines
        if not WATCHERS:
            sys.monitoring.use_tool_id(TOOL, "simulation")
            sys.monitoring.register_callback(TOOL, sys.monitoring.events.LINE, self.look)
            sys.monitoring.set_events(TOOL, sys.monitoring.events.LINE)
        WATCHERS.append(self)

    @staticmethod
    def look(code, line):
        """Count a line."""
        if "/tacdata/" not in code.co_filename:
            return sys.monitoring.DISABLE
        for watcher in list(WATCHERS):
            computer = watcher.faults.world.computer
            if watcher.faults.over:
                watcher.stop()
            elif computer.schedule.task is computer.main and not computer.killed:
                watcher.left -= 1
                if not watcher.left and linecache.getline(code.co_filename, line).lstrip().startswith("with "):
                    watcher.left = 1
                elif not watcher.left:
                    watcher.stop()
                    watcher.faults.see("signal")
                    (computer.handlers.get(watcher.number) or signal.default_int_handler)(watcher.number, None)
        return None

    def stop(self):
        """Count no more."""
        WATCHERS.remove(self)
        if not WATCHERS:
            sys.monitoring.set_events(TOOL, 0)
            sys.monitoring.register_callback(TOOL, sys.monitoring.events.LINE, None)
            sys.monitoring.free_tool_id(TOOL)


def _damage(faults, way, text):
    """Change one byte of one of the next writes."""
    draw = faults.random
    kind = draw.choice(("lost", "doubled", "flipped", "digit"))
    left = [draw.randrange(1, 3)]

    def change(data):
        if not left or draw.random() < 0.3:
            return data
        left[0] -= 1
        if not left[0]:
            left.clear()
        data, at = bytearray(data), draw.randrange(len(data))
        digits = [k for k, byte in enumerate(data) if 0x30 <= byte <= 0x39]
        if kind == "digit" and digits and text:
            data[draw.choice(digits)] = 0x30 + draw.randrange(10)
        elif kind == "lost":
            del data[at]
        elif kind == "doubled":
            data.insert(at, data[at])
        else:
            data[at] ^= 1 << draw.randrange(8)
        return bytes(data)

    way.change = change


def _lose(faults, way):
    """Lose the whole of the next write that is no report."""
    left = [1]

    def change(data):
        if left and not data.startswith((b"<", b"?")):
            left.clear()
            return b""
        return data

    way.change = change


def _late(faults, *ways, most=7.0):
    until = faults.world.schedule.now_ns + round(faults.random.choice((0.05, 0.3, 1.0, most)) * SECOND)
    for way in ways:
        way.held_until = until
    if faults.world.cnc_line.to_host in ways:
        faults.silent(until / SECOND)


def damaged_answer(faults):
    _damage(faults, faults.world.cnc_line.to_host, True)


def damaged_command(faults):
    _damage(faults, faults.world.cnc_line.to_device, True)


def lost_answer(faults):
    _lose(faults, faults.world.cnc_line.to_host)


def lost_command(faults):
    _lose(faults, faults.world.cnc_line.to_device)


def late_answers(faults):
    _late(faults, faults.world.cnc_line.to_host)


def controller_stalls(faults):
    faults.deaf = True
    _late(faults, faults.world.cnc_line.to_host, faults.world.cnc_line.to_device)


def damaged_frame(faults):
    _damage(faults, faults.world.board_line.to_host, False)


def board_stalls(faults):
    _late(faults, faults.world.board_line.to_host)


def board_freezes(faults):
    if faults.frozen:
        return  # frozen anew, it would show another reading once
    last, faults.frozen = [], True

    def same(counts):
        last.append(counts)
        return last[0]

    faults.world.board.inject_readings(same)
    if faults.world.schedule.now > LIVED:  # one that never changed may be a board that rests
        faults.see("board freezes", 2.0)


def board_unplugged(faults):
    faults.world.board_line.close()
    faults.see("board unplugged")


def controller_unplugged(faults):
    faults.deaf = True
    faults.must_end(2.0, words=False)
    faults.world.cnc_line.close()


def controller_mute(faults):
    faults.deaf = True
    faults.must_end(SILENCE, words=False)
    faults.silent()
    faults.world.controller.inject_wire(to_host=lambda text: None)


def _outside(waits, at, seconds):
    """Return the time at which so much time from ``at`` has passed outside of (begin, end) of waits."""
    for begin, end in sorted(waits):
        if end > at and begin < at + seconds:
            at, seconds = end, seconds - max(begin - at, 0.0)
    return at + seconds


def alarm(faults):
    faults.must_end(2.0)
    faults.alarmed = faults.world.schedule.now
    faults.world.controller.inject_alarm(faults.random.choice((1, 2, 3)))


def brown_out(faults):
    faults.must_end(2.0)
    faults.world.controller.inject_brown_out()


def foreign_hold(faults):
    faults.must_end(2.0)
    faults.world.controller.inject_byte(0x21)


def foreign_door(faults):
    faults.must_end(2.0)
    faults.world.controller.inject_byte(0x84)


def door(faults):
    faults.must_end(2.0)
    faults.world.controller.inject_door(True)
    if faults.random.random() < 0.5:
        faults.after(faults.random.uniform(0.05, 3.0), lambda: faults.world.controller.inject_door(False))


def pendant(faults):
    faults.deaf = True
    faults.must_end(2.0)
    faults.world.controller.inject_pendant()


def computer_stalls(faults):
    schedule = faults.world.schedule
    seconds = faults.random.choice((0.1, 0.5, 2.0, 2.9, 3.1, 6.0, 20.0))
    if seconds > 3.5:
        faults.stalled(seconds)
    faults.world.computer.stalls.append((schedule.now_ns, schedule.now_ns + round(seconds * SECOND)))


def disk_full(faults):
    faults.world.computer.disk.room = faults.random.randrange(0, 3000)


def disk_slow(faults):
    now = faults.world.schedule.now_ns
    seconds = faults.random.choice((0.3, 2.0, 9.0))
    faults.world.computer.disk.slow.append((now, now + round(seconds * SECOND)))


def interrupted(faults):
    number = faults.random.choice((signal.SIGINT, signal.SIGTERM))

    def deliver():
        if number in faults.world.computer.handlers:
            faults.see("signal")
        faults.world.computer.send_signal(number)

    deliver()
    for _ in range(faults.random.choice((0, 0, 1, 2))):
        faults.after(faults.random.uniform(0.02, 2.0), lambda: faults.world.computer.send_signal(number))


def interrupted_at_a_line(faults):
    """Deliver one or two signals before any line of the project that the main thread is about to run."""
    number, draw = signal.SIGINT, faults.random
    for _ in range(draw.choice((1, 2))):
        AtALine(faults, number, draw.randrange(1, draw.choice((20, 300, 3000))))


def board_saturates(faults):
    faults.world.board.inject_readings(lambda counts: np.full_like(counts, 65535.0))
    faults.see("board saturates", 2.0)


def killed(faults):
    faults.deaf = True
    faults.world.computer.kill()


KINDS = {
    act.__name__: act
    for act in (
        damaged_answer,
        damaged_command,
        lost_answer,
        lost_command,
        late_answers,
        controller_stalls,
        damaged_frame,
        board_stalls,
        board_freezes,
        board_saturates,
        board_unplugged,
        controller_unplugged,
        controller_mute,
        alarm,
        brown_out,
        foreign_hold,
        foreign_door,
        door,
        pendant,
        computer_stalls,
        disk_full,
        disk_slow,
        interrupted,
        interrupted_at_a_line,
        killed,
    )
}
"""Name -> what happens."""


def camera_hangs(faults):
    """Let no image come for a while; a camera that is silent for 3 s is a fault."""
    if faults.world.camera:
        schedule, seconds = faults.world.schedule, faults.random.choice((0.5, 2.0, 2.8, 20.0))
        faults.world.camera.hangs_until_ns = faults.world.clock.now_ns() + round(seconds * SECOND)
        if seconds > SILENT + 1.0 and schedule.now > LIVED:
            faults.see("camera hangs", SILENT + 0.3)


def camera_unplugged(faults):
    if faults.world.camera:
        faults.world.camera.unplugged = True
        faults.see("camera unplugged")


def controller_garbage(faults):
    faults.world.controller.inject_bytes(faults.random.randbytes(faults.random.choice((1, 5, 40))))


def foreign_override(faults):
    faults.must_end(OVERRIDDEN)
    faults.world.controller.inject_byte(faults.random.choice((0x91, 0x92)))


def pendant_for_a_moment(faults):
    """Let a pendant take control and give it back."""
    faults.deaf = True
    faults.world.controller.inject_pendant()
    clear = lambda: faults.world.controller.inject_wire(lambda line: line, lambda text: text)  # noqa: E731
    faults.after(faults.random.uniform(0.1, 4.0), clear)


MORE = {
    act.__name__: act
    for act in (camera_hangs, camera_unplugged, controller_garbage, foreign_override, pendant_for_a_moment)
}
"""Kinds that came later: a seed draws one of them beside those that it has drawn."""


def damaged_lift(faults):
    """Unplug the board, and change a digit of the line by which the tip is lifted."""
    _change_one(faults, LIFT)
    board_unplugged(faults)


def damaged_press(faults):
    """Change a digit of the next line that goes into the skin or out of it."""
    _change_one(faults, PRESS)


def _change_one(faults, pattern):
    """Let the next line that matches lead a millimetre deeper."""
    damaged = []

    def wire(line):
        if damaged or not pattern.search(line):
            return line
        damaged.append(line)
        return pattern.sub(lambda match: f"{match[1]}{int(match[2]) + 1}", line)

    faults.world.controller.inject_wire(to_controller=wire)


LIFT = re.compile(r"(G1Z-\d)(\d)")
"""A line of a lift: it names no x and y."""
PRESS = re.compile(r"(Y\S+Z-3)(8)")
"""A line of motion to a place in the skin."""


def camera_freezes(faults):
    """Let the camera repeat its image with fresh time stamps, once it has been seen to live."""
    camera = faults.world.camera

    def freeze():
        if camera.frozen_at is None:
            camera.frozen_at = 0
            faults.see("camera freezes", SILENT + 0.3)

    if camera:
        faults.after(max(LIVED + SEEN_LIVING - faults.world.schedule.now, 0.0), freeze)


def reader_starves(faults):
    """Let one thread that reads a port not run for a while: what arrives waits."""
    now, seconds = faults.world.schedule.now_ns, faults.random.choice((0.3, 1.5, 2.5, 4.0, 8.0))
    thread = faults.random.choice(("grbl-listen", "taxel-board"))
    faults.world.computer.starved.append((thread, now, now + round(seconds * SECOND)))


NEWEST = {"camera_freezes": camera_freezes, "reader_starves": reader_starves}
"""Kinds that came last, drawn by numbers of their own."""
LATEST = {"damaged_lift": damaged_lift, "damaged_press": damaged_press}
"""Kinds that came later still."""
ALL = {**KINDS, **MORE, **LATEST, **NEWEST}
"""Every kind."""
