"""Simulated time and tasks: one runs at a time, and the seed decides who is late."""

import heapq
import itertools
import random

from greenlet import GreenletExit, getcurrent, greenlet

SECOND = 1_000_000_000
GLANCE = 500
"""Time that one look at the clock takes [ns], so that no loop of looks stands still."""


class Killed(GreenletExit):
    """The process was ended from outside (kill -9, a power cut), or the world has ended."""


class Hung(AssertionError):
    """Something waits for ever, or for longer than the world lasts."""


class Schedule:
    """Runs tasks in the order of their times; ends when told to."""

    def __init__(self, seed, limit):
        """Begin at time 0, with ``limit`` [s] until it counts as hung."""
        self.random, self.now_ns, self._limit_ns = random.Random(seed), 0, round(limit * SECOND)
        self.tasks = []
        self._due, self._order = [], itertools.count()
        self._hub, self._running = None, None

    @property
    def now(self):
        """Time since the beginning [s]."""
        return self.now_ns / SECOND

    @property
    def task(self):
        """The task that runs, or None outside of all."""
        return self._running

    def glance(self):
        """Return the time [ns] as a program sees it."""
        self.now_ns += GLANCE
        return self.now_ns

    def at(self, time_ns, action):
        """Do something at a time [ns], outside of all tasks."""
        self._push(time_ns, action, 0)

    def wake(self, task, delay_ns=0):
        """Let a waiting task go on."""
        self._push(self.now_ns + delay_ns, task, task.turn, True)

    def block(self, deadline_ns=None):
        """Let others run until this task is woken or the time has come; return whether it was woken."""
        task = self._running
        assert task is not None, "what waits must be a task"
        while True:
            task.allow()
            task.turn += 1
            if deadline_ns is not None:
                self._push(max(deadline_ns, self.now_ns), task, task.turn, False)
            woken = self._hub.switch()
            task.allow()
            if task.signals:
                task.take_signals()
                if not woken and (deadline_ns is None or self.now_ns < deadline_ns):
                    continue
            return woken

    def run(self, main):
        """Run until ``main`` has ended; the other tasks stay where they are.

        Raises:
            Hung: If it waits for ever, or the world's time is over.
        """
        self._hub = getcurrent()
        while not main.ended:
            if not self._due:
                raise Hung(f"everything waits for ever: {self.waiting()}")
            time_ns, _, what, turn, woken = heapq.heappop(self._due)
            if time_ns > self._limit_ns:
                raise Hung(f"not ended after {self._limit_ns / SECOND:g} s: {self.waiting()}")
            if callable(what):
                self.now_ns = max(self.now_ns, time_ns)
                what()
            elif what.turn == turn and not what.ended:
                late_ns = what.process.late(time_ns, what.name)
                if late_ns:
                    self._push(time_ns + late_ns, what, turn, woken)
                    continue
                self.now_ns = max(self.now_ns, time_ns)
                self._switch(what, woken)

    def waiting(self):
        """Return the names of the tasks that have not ended."""
        return ", ".join(task.name for task in self.tasks if not task.ended)

    def extend(self, seconds):
        """Let the world last so much longer from now [s]."""
        self._limit_ns = self.now_ns + round(seconds * SECOND)

    def run_for(self, seconds, process):
        """Let time pass [s] for what ``process`` and others do."""
        main = Task(self, process, "pass", lambda: process.sleep(seconds))
        main.start()
        self.run(main)

    def end(self, task):
        """End a task now, wherever it waits."""
        if not task.ended and task is not self._running:
            task.killed = True
            self._switch(task, False)

    def _switch(self, task, woken):
        before, self._running, hub = self._running, task, self._hub
        self._hub = task.greenlet.parent = getcurrent()  # where it goes when it has ended, too
        try:
            task.greenlet.switch(woken)
        finally:
            self._running, self._hub = before, hub

    def _push(self, time_ns, what, turn, woken=False):
        heapq.heappush(self._due, (time_ns, next(self._order), what, turn, woken))


class Task:
    """What a thread does."""

    def __init__(self, schedule, process, name, work):
        """Prepare it; ``process`` says whether it may still run, and how late."""
        self.schedule, self.process, self.name = schedule, process, name
        self.turn, self.ended, self.killed, self.error = 0, False, False, None
        self.signals, self.joined = [], []
        self._work = work
        self.greenlet = greenlet(self._run)

    def start(self):
        """Let it run as soon as others wait."""
        self.schedule.tasks.append(self)
        self.schedule.wake(self)

    def allow(self):
        """Raise if its process was killed."""
        if self.killed:
            raise Killed

    def take_signals(self):
        """Do what the signals' handlers do, which may raise."""
        while self.signals:
            handler, number = self.signals.pop(0)
            handler(number, None)

    def _run(self, _woken):
        try:
            self.allow()
            self._work()
        except Killed:
            pass
        except BaseException as error:  # handed to whoever looks
            self.error = error
        self.ended = True
        for task in self.joined:
            self.schedule.wake(task)
