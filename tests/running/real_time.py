"""What drives devices in real time is tried again if it failed while the machine stood still, and only then."""

import functools
import os
import signal
import threading
import time
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
ROOMS = (
    "commands",
    "demonstrations",
    "devices",
    "label_farm",
    "live",
    "recording",
    "registration",
    "replay",
    "virtual_rig",
)
"""Rooms whose tests hold emulated devices, hosts or processes against the clock; they wait more than they compute."""
RIGS = ("test_closed_loop.py",)
"""Files of other rooms that do: a press that a late machine spoilt stands out there, and nothing is named."""
STILL = 0.02
"""A thread that wakes so much too late was kept from the machine [s]; an emulated carriage moves 0.2 mm meanwhile."""
SPEED = 10.0
"""Rate of an emulated rig's clock at the first try [s a second]."""


@functools.cache
def in_real_time(path):
    """Return whether the tests of a file, a path in this folder, watch the clock."""
    return path.relative_to(TESTS).parts[0] in ROOMS or path.name in RIGS


class Watch:
    """A thread that sleeps, and notes how much too late it ever woke.

    Only beside tests of real time: it takes half a hundredth of a core.
    """

    PERIOD = 0.01

    def __init__(self):
        self.latest, self._wanted = 0.0, threading.Event()
        threading.Thread(target=self._watch, daemon=True, name="machine watch").start()

    def _watch(self):
        while self._wanted.wait():
            before = time.monotonic()
            time.sleep(self.PERIOD)
            self.latest = max(self.latest, time.monotonic() - before - self.PERIOD)

    def begin(self, wanted):
        """Watch a test from now on, or rest."""
        self.latest = 0.0
        (self._wanted.set if wanted else self._wanted.clear)()

    def stood_still(self):
        """Return whether the machine was late, or has more to do than it has cores, since the test began."""
        return self.latest > STILL or os.getloadavg()[0] > (os.cpu_count() or 1)


WATCH = Watch()


def pytest_configure():
    """Let Ctrl-C and a hang-up reach tests that a script or nohup started in the background, where both are ignored."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(items):
    """Let tests of real time be tried again."""
    for item in items:
        if in_real_time(item.path):
            item.add_marker(pytest.mark.flaky(reruns=2, condition=WATCH.stood_still))


@pytest.fixture
def speed(request):
    """Rate of an emulated rig's clock [s a second]; half of it at every further try: a busy machine keeps up."""
    return SPEED / 2 ** (request.node.execution_count - 1)


def pytest_runtest_setup(item):
    """Watch anew for every test."""
    WATCH.begin(in_real_time(item.path))


def pytest_terminal_summary(terminalreporter):
    """Print why tests were tried again: the next try may pass, and a fault would hide behind it."""
    tried = terminalreporter.stats.get("rerun", [])
    if tried:
        terminalreporter.section("tried again")
    for report in tried:
        crash = getattr(report.longrepr, "reprcrash", None)
        reason = " ".join((crash.message if crash else str(report.longrepr)).split())
        terminalreporter.line(f"{report.nodeid} ({report.when}): {reason[:300]}")
