"""The web viewer really serves, on this machine only, and tells nobody."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from tacdata.errors import UsageError
from tacdata.viewers.rerun import window
from tacdata.viewers.rerun.backend import RerunBackend
from tacdata.viewers.scenes.episode import episode_scene


def listens(host, port):
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex((host, port)) == 0


def other_address():
    """An address of this machine beside the loopback, or None."""
    try:
        return next(
            a[4][0] for a in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET) if a[4][0][:4] != "127."
        )
    except (OSError, StopIteration):
        return None


def test_the_web_viewer_serves_on_the_loopback_only(episode, tmp_path):
    RerunBackend(tmp_path / "e.rrd").draw(episode_scene(episode))
    with window.web_server(tmp_path / "e.rrd") as (server, address):
        parts = urlsplit(address)
        grpc = urlsplit(parse_qs(parts.query)["url"][0].removeprefix("rerun+"))
        assert parts.hostname == grpc.hostname == "127.0.0.1"
        for _ in range(600):
            if server.poll() is not None or (listens("127.0.0.1", parts.port) and listens("127.0.0.1", grpc.port)):
                break
            time.sleep(0.1)
        assert server.poll() is None
        with urllib.request.urlopen(f"http://127.0.0.1:{parts.port}/", timeout=60) as answer:
            assert b"<html" in answer.read().lower()
            allowed = dict(part.split(" ", 1) for part in answer.headers["Content-Security-Policy"].split("; "))
        # What the page in the browser may call: this machine, and nobody who counts users.
        reached = {word for word in allowed["connect-src"].split() if word.startswith(("http", "*", "https"))}
        assert reached == {"http://127.0.0.1:*", "http://localhost:*"}
        with urllib.request.urlopen(f"http://127.0.0.1:{parts.port}/re_viewer_bg.wasm") as code:
            assert code.headers["Content-Type"] == "application/wasm" and "Content-Security-Policy" in code.headers
            assert len(code.read()) == int(code.headers["rerun-final-length"])
        if (outside := other_address()) is not None:
            assert not listens(outside, parts.port)
            assert not listens(outside, grpc.port)
    assert server.poll() is not None
    assert not listens("127.0.0.1", parts.port)


SERVED = """
import sys
from contextlib import suppress
from pathlib import Path
from tacdata.viewers.rerun import window
with window.web_server(Path(sys.argv[1])) as (server, _), suppress(KeyboardInterrupt):
    print(server.pid, flush=True)
    window.until_interrupted()
"""
"""Ctrl-C may come as soon as the number is read, before anybody waits for it."""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_no_viewer_outlives_who_started_it(episode, tmp_path, number):
    RerunBackend(tmp_path / "e.rrd").draw(episode_scene(episode))
    command = [sys.executable, "-c", SERVED, str(tmp_path / "e.rrd")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        viewer = int(process.stdout.readline())
        process.send_signal(number)
        assert process.wait(60) == (0 if number == signal.SIGINT else 128 + number)
    assert not Path(f"/proc/{viewer}").exists()


def test_usage_statistics_are_off_and_the_users_setting_is_left_alone():
    before = os.environ.get("XDG_CONFIG_HOME")
    with window.quiet_environment() as environment:
        told = subprocess.run(
            [window.executable(), "analytics", "config"], env=environment, capture_output=True, text=True
        )
        folder = Path(environment["XDG_CONFIG_HOME"])
        assert json.loads(told.stdout)["analytics_enabled"] is False
        assert folder.is_dir()
    assert not folder.exists()
    assert os.environ.get("XDG_CONFIG_HOME") == before


def test_a_port_in_use_is_avoided():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert window.free_port(port) != port
    assert window.free_port(port) == port


def test_without_a_display_no_window_is_tried(monkeypatch, tmp_path):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(UsageError, match="no display"):
        window.window(tmp_path / "e.rrd")
