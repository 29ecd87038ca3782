"""Worker processes of this computer for a service elsewhere: started, replaced when they die, stopped cleanly."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from contextlib import suppress

from tacdata.errors import SolveError, TacdataError
from tacdata.label_farm import environment
from tacdata.label_farm.presses.model import FACTORY
from tacdata.label_farm.remote.client import Client

WATCH_SECONDS = 0.5
MOST_DEATHS = 20


class Crew:
    """The processes behind `tacdata farm worker`."""

    def __init__(self, url: str, token: str, processes: int | None, devices: tuple[str, ...], factory: str) -> None:
        """Find the service.

        Raises:
            DeviceError: If it cannot be reached.
            UsageError: If it refuses the token.
        """
        self._client = Client(url, token)
        self._client.get("/api/work/offers")
        self._devices = environment.devices(devices)
        ready = environment.cores() if self._devices == ("cpu",) else len(self._devices)
        self._count = processes or ready
        self._asked = {"url": url, "token": token, "factory": factory or FACTORY}

    def work(self) -> None:
        """Keep the processes working until interrupted.

        Raises:
            SolveError: If they keep dying.
        """
        environment.end_on_terminate()
        crew = [self._start(k) for k in range(self._count)]
        print(f"{self._count} workers for {self._client.url}; Ctrl-C stops them", flush=True)
        deaths = 0
        try:
            while True:
                time.sleep(WATCH_SECONDS)
                for k, process in enumerate(crew):
                    if process.poll() is not None:
                        deaths += 1
                        print(f"worker {process.pid} ended with {process.returncode}; replaced", file=sys.stderr)
                        self._leave(process)
                        if deaths > MOST_DEATHS:
                            raise SolveError(f"{deaths} workers died", "workers that live", "see what they said above")
                        crew[k] = self._start(k)
        finally:
            for process in crew:
                process.kill()
                process.wait()
                self._leave(process)

    def _start(self, number: int) -> subprocess.Popen[str]:
        device = self._devices[number % len(self._devices)]
        # A process group of its own: Ctrl-C reaches the crew alone, which stops the workers.
        process = subprocess.Popen(
            environment.python("tacdata.label_farm.remote.worker"),
            env=environment.variables(device),
            process_group=0,
            text=True,
            stdin=subprocess.PIPE,
        )
        with suppress(BrokenPipeError):
            if process.stdin is not None:
                process.stdin.write(json.dumps({**self._asked, "device": device}) + "\n")
                process.stdin.flush()
        return process

    def _leave(self, process: subprocess.Popen[str]) -> None:
        with suppress(BrokenPipeError):
            if process.stdin is not None:
                process.stdin.close()
        # Its jobs are given back at once; where the service is away, its claims expire.
        with suppress(TacdataError):
            self._client.post("/api/work/leave", {"owner": f"{socket.gethostname()}/{process.pid}"})
