"""Opens a Rerun file in a window or a browser, on this machine only and without usage statistics."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.viewers.rerun.shield import LOOPBACK, shielded
from tacdata.viewers.rerun.steering import Moment, steer

GRPC_PORT, WEB_PORT = 9876, 9090
"""Rerun's own ports; others are taken where these are in use."""

_BY_SIGNAL = 128
"""Exit status of a program that a signal ended, less the signal's number, as POSIX shells count."""


def has_display() -> bool:
    """Say whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def require_display(remedy: str = "add --save FILE.rrd, --picture FILE.png, or --web") -> None:
    """Refuse to open a window where there is none.

    Args:
        remedy: The alternative for the user.

    Raises:
        UsageError: Naming the alternative.
    """
    if not has_display():
        raise UsageError(
            "no display to open a window on",
            "a display (DISPLAY or WAYLAND_DISPLAY is set), or an output that needs none",
            remedy,
        )


def free_port(preferred: int) -> int:
    """Return ``preferred`` if nothing listens there on the loopback, else a free port."""
    with socket.socket() as probe:
        # Without this a port just left by another viewer counts as taken.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, preferred))
        except OSError:
            return any_port()
    return preferred


def any_port() -> int:
    """Return a free port on the loopback."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


@contextmanager
def quiet_environment() -> Iterator[dict[str, str]]:
    """Yield an environment in which Rerun's usage statistics are off, leaving the user's own choice alone."""
    with tempfile.TemporaryDirectory(prefix="tacdata-rerun-") as folder:
        # Rerun stores the choice in its configuration folder, which is a temporary one here.
        environment = {**os.environ, "XDG_CONFIG_HOME": folder}
        subprocess.run([executable(), "analytics", "disable"], env=environment, capture_output=True, timeout=60)
        yield environment


def executable() -> str:
    """Return the path of the viewer that the package rerun-sdk ships.

    Raises:
        UsageError: If it ships none for this platform.
    """
    import rerun_cli

    folder = Path(rerun_cli.__file__).parent
    for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
        if (folder / name).is_file():
            return str(folder / name)
    raise UsageError(
        "the installed rerun-sdk ships no viewer for this platform",
        "a wheel with one",
        "use --save FILE.rrd and open the file with Rerun on another machine",
    )


def window(file: Path, moment: Moment | None = None) -> None:
    """Show a file in a native window; returns when the window is closed.

    Args:
        file: The file.
        moment: Its time when it opens; else the beginning.

    Raises:
        UsageError: If there is no display.
    """
    require_display()
    with quiet_environment() as environment:
        port = free_port(GRPC_PORT)
        command = [executable(), "--bind", LOOPBACK, "--port", str(port), str(file)]
        # The window is ended with this process, or closed by the person.
        with _running(command, environment) as viewer:
            if moment is not None:
                threading.Thread(target=steer, args=(port, moment), daemon=True).start()
            wait_for(viewer)


def wait_for(viewer: subprocess.Popen) -> None:
    """Return when a viewer has been closed.

    Raises:
        UsageError: If it broke down instead.
    """
    if code := viewer.wait():
        raise UsageError(
            f"the viewer ended with code {code}",
            "a display with working graphics, or with --web a machine that lets it listen",
            "add --save FILE.rrd or --picture FILE.png, which need neither",
        )


@contextmanager
def web_server(file: Path, moment: Moment | None = None) -> Iterator[tuple[subprocess.Popen, str]]:
    """Serve a file with Rerun's web viewer on the loopback; its time is at a moment, else at the beginning.

    Yields:
        The serving process and the address to open.
    """
    grpc, web = free_port(GRPC_PORT), any_port()
    arguments = ["--serve-web", "--bind", LOOPBACK, "--port", str(grpc), "--web-viewer-port", str(web), str(file)]
    with quiet_environment() as environment, running(arguments, environment) as server:
        with shielded(web, free_port(WEB_PORT)) as page:
            address = f"{page}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{grpc}%2Fproxy"
            yield server, address + (moment.query if moment else "")


@contextmanager
def running(arguments: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen]:
    """Run the viewer that rerun-sdk ships while the context lasts."""
    with _running([executable(), *arguments], environment) as process:
        yield process


@contextmanager
def _running(command: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen]:
    with _ended_in_order():
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            yield process
        finally:
            # Asked first: Rerun then closes its ports in order.
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Unwind when this process is asked to end, so that no viewer outlives it; a handler that is set already stays."""

    def end(number: int, _: object) -> None:
        raise SystemExit(_BY_SIGNAL + number)

    signals = (signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
    main = threading.current_thread() is threading.main_thread()  # only there may handlers be set
    ours = [number for number in signals if main and signal.getsignal(number) is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def until_interrupted() -> None:
    """Wait for Ctrl-C."""
    with suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600)
