"""Test files side by side: those that compute on every core, those that mostly wait for a clock beside them.

`pytest --numprocesses 4 --waiting 2`: two of four processes take files that hold devices to the clock. The others stand
back (nice): an emulated device is then seldom late. Whoever has no file of its kind left takes one of the other. Files
that took longest go first (`durations.csv`, of the long part `long_runs.json`). Rooms whose files compile or import the
same things go to one process.
"""

import os
from pathlib import Path

from running import long_part
from running.durations import recorded
from running.real_time import in_real_time
from xdist.scheduler import LoadFileScheduling

from tacdata.viewers.rerun import window

ROOT = Path(__file__).parents[2]
STAND_BACK = 3
"""How much computing processes are put back (nice): more would leave them next to nothing on a busy machine."""
PORTS = 7
"""How far apart processes ask for a viewer's ports: two that begin at the same time would both find one free."""
TOGETHER = {"skin": "skin", "dataset": "dataset", "exporters": "dataset"}
"""Rooms whose quick tests are handed out as one: a second process would compile their kernels and import lerobot."""
UNKNOWN = 15.0
"""What a file counts that has not been timed yet [s]: it begins before the many short ones, after the long."""


def pytest_addoption(parser):
    """Add the number of processes that wait."""
    parser.addoption("--waiting", type=int, default=0, help="how many of the processes take what waits for a clock")


def pytest_configure(config):
    """Stand back in a process that computes; have viewers of other processes take other ports."""
    if not hasattr(config, "workerinput"):
        return
    worker = config.workerinput["workerid"]
    if config.option.waiting and not waits(worker, config):
        os.nice(STAND_BACK)
    own = PORTS * (1 + int(worker.removeprefix("gw")))
    window.GRPC_PORT += own
    window.WEB_PORT += own


def waits(worker, config):
    """Return whether a worker, "gw0" or "gw1" or ..., takes what waits for a clock."""
    return int(worker.removeprefix("gw")) < config.option.waiting


def pytest_xdist_make_scheduler(config, log):
    """Give files out by their kind."""
    return ByKind(config, log) if config.option.waiting else None


class ByKind(LoadFileScheduling):
    """Gives each process a file of its kind as long as there is one, the longest first."""

    def schedule(self):
        """Sort the files before the first are given out."""
        if self.collection is None:
            self.config.option.loadscopereorder = False
        super().schedule()

    def _split_scope(self, nodeid):
        file = super()._split_scope(nodeid)
        together = TOGETHER.get(file.split("/")[1])
        return f"tests/{together}" if together and not self.config.option.long else file

    def _assign_work_unit(self, node):
        own = waits(node.gateway.id, self.config)
        seconds = long_part.seconds() if self.config.option.long else recorded()

        def order(scope):
            files = {nodeid.split("::")[0] for nodeid in self.workqueue[scope] or [scope]}
            return in_real_time(ROOT / scope) != own, -sum(seconds.get(file, UNKNOWN) for file in files)

        self.workqueue.move_to_end(min(self.workqueue, key=order), last=False)
        super()._assign_work_unit(node)
