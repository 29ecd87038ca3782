"""Sets the time of an open viewer, so that it opens at the deepest moment.

A window is asked through Rerun's own client. The viewer in a browser runs a script that `viewers.rerun.shield` adds
to its page. The script takes the moment from the address (``at=TIMELINE@NANOSECONDS``) or from the page around it.
It sends that page the moment to show.
"""

import time
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from urllib.parse import quote

import numpy as np

from tacdata.viewers.rerun.timelines import ELAPSED, HOST
from tacdata.viewers.scene.moments import moments
from tacdata.viewers.scene.scene import Scene

PATIENCE = 30.0
"""Time that a window may take until it listens [s]."""


@dataclass(frozen=True)
class Moment:
    """A time on one of a recording's timelines."""

    timeline: str
    ns: int
    """Time on it [ns]."""

    def __str__(self) -> str:
        """Return it as an address has it."""
        return f"{self.timeline}@{self.ns}"

    @property
    def query(self) -> str:
        """Addition to a viewer's address."""
        return f"&at={quote(str(self))}"


def deepest_moment(scene: Scene) -> Moment | None:
    """Return the deepest moment of a press; None for a scene that shows no press."""
    if not scene.maps and not scene.arrays:
        return None
    time_ns = dict(moments(scene)).get("deepest")
    return None if time_ns is None else Moment(HOST if scene.on_host_clock else ELAPSED, time_ns)


def script() -> str:
    """Return the addition to the page of Rerun's web viewer."""
    return f"<script>{files('tacdata.viewers.rerun').joinpath('steering.js').read_text()}</script>"


def steer(port: int, moment: Moment) -> None:
    """Set the time of a window that listens on a port of this machine; one that does not take it stays as it is."""
    from rerun.experimental import ViewerClient

    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with suppress(Exception):  # not listening yet, nothing loaded yet, or an older or newer viewer
            viewer = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            if moment.timeline == HOST:
                viewer.set_time(HOST, timestamp=np.datetime64(moment.ns, "ns"), play_state="paused")
            else:
                viewer.set_time(moment.timeline, duration=np.timedelta64(moment.ns, "ns"), play_state="paused")
            return
        time.sleep(0.3)
