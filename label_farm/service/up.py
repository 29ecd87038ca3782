"""Starts the service: checked settings, one socket, the foreman's thread."""

from __future__ import annotations

import ipaddress
import socket
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.presses.model import FACTORY
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.engine import EngineMaker
from tacdata.label_farm.workers.pool import Pool

SHORTEST_TOKEN = 16


@dataclass(frozen=True)
class UpSettings:
    """How the service is started."""

    root: Path
    """Folder that sessions are named from."""
    store: Path | None = None
    """Folder of solved presses and submissions; None for ``root/farm``."""
    host: str = "127.0.0.1"
    """Address to listen on."""
    port: int = 8765
    """Port; 0 for any that is free."""
    token: str = ""
    """Token of every request."""
    workers: int | None = None
    """Worker processes; None for one a GPU or core."""
    devices: tuple[str, ...] = ()
    """Their devices, see `environment.devices`; empty for the processor."""
    dask: str = ""
    """Address of a Dask scheduler, "here" to start one, or "" for local processes."""
    factory: str = ""
    """Dotted path of the function that builds the model."""


def up(asked: UpSettings) -> None:
    """Serve until interrupted.

    Raises:
        UsageError: If the address is taken or not allowed, the token too short, or the store in use.
    """
    import uvicorn

    from tacdata.label_farm.service.app import application
    from tacdata.label_farm.service.foreman import Foreman

    _check_token(asked)
    if not asked.root.is_dir():
        raise UsageError(f"no folder {asked.root}", "the folder that the sessions lie in", "name it with --root")
    root, settings = asked.root.resolve(), _settings(asked)
    with closing(_listen(asked.host, asked.port)) as listener:
        foreman = Foreman(root, Store(asked.store or root / "farm"), settings)
        host = f"[{asked.host}]" if ":" in asked.host else asked.host
        address = f"http://{host}:{listener.getsockname()[1]}"
        foreman.announce(address)
        foreman.start()
        print(f"label farm of {root} at {address}", flush=True)
        if hint := "" if asked.dask else environment.idle_gpus(asked.devices):
            print(hint, flush=True)
        print("open it in a browser, or: tacdata farm submit SESSION --url " + address, flush=True)
        config = uvicorn.Config(
            application(foreman, asked.token),
            log_level="warning",
            timeout_graceful_shutdown=3,
            server_header=False,
            # Limits the head of a request; `guard` limits its body.
            h11_max_incomplete_event_size=64 * 1024,
            lifespan="off",
        )
        try:
            uvicorn.Server(config).run(sockets=[listener])
        finally:
            foreman.stop()
            print("stopped: what was submitted goes on with the next `tacdata farm up`", flush=True)


def _settings(settings: UpSettings) -> FarmSettings:
    devices = environment.devices(settings.devices)
    ready = environment.cores() if devices == ("cpu",) else len(devices)
    workers = ready if settings.workers is None else settings.workers
    return FarmSettings(
        factory=settings.factory or FACTORY, workers=workers, devices=devices, engine=_engine(settings.dask)
    )


def _engine(dask: str) -> EngineMaker:
    if not dask:
        return Pool
    from tacdata.label_farm.workers.dask_pool import dask_engine

    return dask_engine(dask)


def _check_token(settings: UpSettings) -> None:
    if settings.token and (
        len(settings.token) < SHORTEST_TOKEN or not settings.token.isascii() or " " in settings.token
    ):
        raise UsageError(
            f"a token of {len(settings.token)} characters",
            f"at least {SHORTEST_TOKEN}, plain letters and digits",
            "python -c 'import secrets; print(secrets.token_urlsafe())' makes one",
        )
    if not settings.token and not _is_loopback(settings.host):
        raise UsageError(
            f"to listen on {settings.host} without a token",
            "127.0.0.1, or a token that every request must carry",
            "set TACDATA_FARM_TOKEN (or --token), here and for whoever submits; put TLS before it on an open network",
        )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)  # before the address is printed: early clients wait
    except OSError as error:
        listener.close()
        raise UsageError(
            f"cannot listen on {host}:{port}: {error.strerror or error}",
            "an address of this computer, a free port",
            "name another with --host and --port; 0 takes any free port",
        ) from None
    return listener
