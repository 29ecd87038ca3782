"""A computer in a simulated world: its threads are tasks, its time is the world's, its disk fails when told to."""

import queue
from contextlib import suppress

from schedule import SECOND, Task

from tacdata.host import Host

START = 1000 * SECOND
"""What a monotonic clock shows at the beginning of the world [ns]."""
EPOCH = 1_760_000_000 * SECOND
"""Unix time then [ns]."""


class SimulatedHost(Host):
    """One computer, or one process of it.

    `stalls` are stretches of time [ns] in which nothing of it runs, `starved` (thread, begin, end) those of one thread.
    `preempt` is the probability that another task runs at a place where it might.
    """

    def __init__(self, schedule, preempt=0.0, lateness=()):
        """Begin; ``lateness`` are (probability, most [s]) of a task that wakes too late."""
        self.schedule, self.preempt, self.lateness = schedule, preempt, lateness
        self.stalls, self.starved, self.tasks, self.handlers = [], [], [], {}
        self.main, self.disk, self.killed = None, None, False

    def late(self, time_ns, name):
        """Return by how much a task of this name that should run now must wait [ns]."""
        for begin, end in [*self.stalls, *self.unheard(name)]:
            if begin <= time_ns < end:
                return end - time_ns + self.schedule.random.randrange(1000, 1_000_000)
        return 0

    def unheard(self, thread):
        """Return the stretches of time (begin, end) [ns] in which one thread is starved."""
        return [(begin, end) for name, begin, end in self.starved if name == thread]

    def run(self, work):
        """Run ``work`` as the main thread of a process and return what it returns, or raise what it raises."""
        found = []
        self.main = Task(self.schedule, self, "main", lambda: found.append(work()))
        self.tasks.append(self.main)
        self.main.start()
        self.schedule.run(self.main)
        if self.main.error:
            raise self.main.error
        return found[0] if found else None

    def kill(self):
        """End the process at once, wherever its threads are (kill -9)."""
        self.killed = True
        for task in self.tasks:
            task.killed = True
        for task in self.tasks:
            self.schedule.end(task)

    def send_signal(self, number):
        """Deliver a signal to the main thread."""
        if self.handlers.get(number) and self.main and not self.main.ended:
            self.main.signals.append((self.handlers[number], number))
            self.schedule.wake(self.main)

    def perhaps(self):
        """Let another task run, with the probability `preempt`."""
        task = self.schedule.task
        if task is not None and self.preempt and self.schedule.random.random() < self.preempt:
            self.schedule.block(self.schedule.now_ns + self.schedule.random.randrange(1000, 3_000_000))

    def after(self, seconds):
        """Return when a wait ends [ns]: never early, and late as the lateness is drawn."""
        if seconds is None:
            return None
        draw, late = self.schedule.random, 50_000
        for probability, most in self.lateness:
            if draw.random() < probability:
                late += int(draw.random() * most * SECOND)
        return self.schedule.now_ns + max(round(seconds * SECOND), 0) + late

    def monotonic(self):
        return self.monotonic_ns() / SECOND

    def monotonic_ns(self):
        return START + self.schedule.glance()

    def time_ns(self):
        return EPOCH + self.schedule.glance()

    def sleep(self, seconds):
        end = self.after(seconds)
        while self.schedule.now_ns < end:
            self.schedule.block(end)

    def thread(self, target, name, args=()):
        return SimulatedThread(self, target, name, args)

    def event(self):
        return SimulatedEvent(self)

    def condition(self):
        return SimulatedCondition(self)

    def lock(self):
        return SimulatedLock(self)

    def queue(self):
        return SimulatedQueue(self)

    def create(self, path):
        return self.disk.create(path) if self.disk else super().create(path)

    def sync(self, stream):
        if self.disk:
            self.disk.sync(stream)
        else:
            stream.flush()

    def signal(self, number, handler):
        before, self.handlers[number] = self.handlers.get(number), handler
        return before


class SimulatedThread:
    """A thread."""

    def __init__(self, host, target, name, args):
        self.name, self._host = name, host
        self._task = Task(host.schedule, host, name, lambda: target(*args))
        self._started = False

    def start(self):
        self._started = True
        self._host.tasks.append(self._task)
        self._task.start()
        self._host.perhaps()

    def is_alive(self):
        return self._started and not self._task.ended

    def join(self, timeout=None):
        end = self._host.after(timeout)
        schedule = self._host.schedule
        while not self._task.ended and (end is None or schedule.now_ns < end):
            self._task.joined.append(schedule.task)
            try:
                schedule.block(end)
            finally:
                with suppress(ValueError):
                    self._task.joined.remove(schedule.task)


class Waiters:
    """The tasks that wait for one thing."""

    def __init__(self, host):
        self._host, self._tasks = host, []

    def wait(self, end):
        """Wait until woken or ``end`` [ns]; return whether woken."""
        schedule = self._host.schedule
        task = schedule.task
        self._tasks.append(task)
        try:
            return schedule.block(end)
        finally:
            with suppress(ValueError):
                self._tasks.remove(task)

    def wake(self):
        """Wake all."""
        for task in self._tasks:
            self._host.schedule.wake(task, self._host.schedule.random.randrange(1000, 100_000))
        self._tasks = []


class SimulatedLock:
    """A reentrant lock."""

    def __init__(self, host):
        self._host, self._waiters = host, Waiters(host)
        self._owner, self._count = None, 0

    def acquire(self):
        task = self._host.schedule.task
        if self._owner is not task or not self._count:
            self._host.perhaps()
        while self._count and self._owner is not task:
            self._waiters.wait(None)
        self._owner, self._count = task, self._count + 1
        return True

    def release(self):
        task = self._host.schedule.task
        if task is not None and task.killed:
            return
        if not self._count or self._owner is not task:
            raise RuntimeError("cannot release un-acquired lock")
        self._count -= 1
        if not self._count:
            self._owner = None
            self._waiters.wake()

    def let_go(self):
        """Release it however often it was taken; return how often."""
        count, self._count, self._owner = self._count, 0, None
        self._waiters.wake()
        return count

    def take_back(self, count):
        """Take it as often as before."""
        self.acquire()
        self._count = count

    def __enter__(self):
        return self.acquire()

    def __exit__(self, *exception):
        self.release()


class SimulatedCondition(SimulatedLock):
    """A condition and its lock."""

    def __init__(self, host):
        super().__init__(host)
        self._told = Waiters(host)

    def __exit__(self, *raised):
        # As `tacdata.host.Condition`: an interrupt may come while the lock is taken back.
        if raised[0] is None or self._owner is self._host.schedule.task:
            self.release()

    def wait(self, timeout=None):
        count = self.let_go()
        try:
            return self._told.wait(self._host.after(timeout))
        finally:
            self.take_back(count)

    def wait_for(self, predicate, timeout=None):
        end = self._host.after(timeout)
        while not (result := predicate()):
            left = None if end is None else (end - self._host.schedule.now_ns) / SECOND
            if left is not None and left <= 0:
                break
            self.wait(left)
        return result

    def notify_all(self):
        self._told.wake()


class SimulatedEvent:
    """A flag."""

    def __init__(self, host):
        self._host, self._waiters, self._set = host, Waiters(host), False

    def is_set(self):
        return self._set

    def set(self):
        self._set = True
        self._waiters.wake()
        self._host.perhaps()

    def clear(self):
        self._set = False

    def wait(self, timeout=None):
        end = self._host.after(timeout)
        while not self._set and (end is None or self._host.schedule.now_ns < end):
            self._waiters.wait(end)
        return self._set


class SimulatedQueue:
    """A queue."""

    def __init__(self, host):
        self._host, self._waiters, self._items = host, Waiters(host), []

    def put(self, item):
        self._items.append(item)
        self._waiters.wake()

    def empty(self):
        return not self._items

    def get(self, block=True, timeout=None):
        end = self._host.after(timeout)
        while not self._items:
            if end is not None and self._host.schedule.now_ns >= end:
                raise queue.Empty
            self._waiters.wait(end)
        return self._items.pop(0)
