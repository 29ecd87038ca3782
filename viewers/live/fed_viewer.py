"""A running Rerun viewer that shows logged data: a window, or the web viewer on the loopback."""

import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from tacdata.viewers.rerun.shield import LOOPBACK, shielded
from tacdata.viewers.rerun.window import GRPC_PORT, WEB_PORT, any_port, free_port, quiet_environment, running

START = 30.0
"""Longest wait for the viewer [s of real time]."""


@dataclass(frozen=True)
class FedViewer:
    """A running viewer."""

    process: subprocess.Popen
    address: str
    """Address for a browser; empty for a window."""
    feed: str
    """Where it listens."""

    def connect(self, recording: Any) -> None:
        """Send a Rerun recording (`rerun.RecordingStream`) to the viewer from now on."""
        recording.connect_grpc(self.feed)


@contextmanager
def fed_viewer(web: bool) -> Iterator[FedViewer]:
    """Start a viewer that takes logged data, for as long as the context lasts.

    Raises:
        TimeoutError: If it does not listen.
    """
    with quiet_environment() as environment:
        port, inner = free_port(GRPC_PORT), any_port()
        # The viewer keeps all that was logged: without a limit a long session would fill the memory.
        command = ["--bind", LOOPBACK, "--port", str(port), "--memory-limit", "500MB"]
        if web:
            command += ["--serve-web", "--web-viewer-port", str(inner), "--server-memory-limit", "200MB"]
        with running(command, environment) as process, ExitStack() as shield:
            _wait_for(port)
            page = shield.enter_context(shielded(inner, free_port(WEB_PORT))) if web else ""
            # Percent-encoded: the whole address of the feed is one parameter of the page's.
            address = f"{page}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{port}%2Fproxy"
            yield FedViewer(process, address if web else "", f"rerun+http://{LOOPBACK}:{port}/proxy")


def _wait_for(port: int) -> None:
    """Return once the viewer listens; earlier data is lost."""
    end = time.monotonic() + START / 2
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.05)
    raise TimeoutError(f"the viewer does not listen on port {port}")
