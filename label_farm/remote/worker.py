"""A worker process for a service elsewhere: ``python -m label_farm.remote.worker``, as `crew.py` starts it.

It reads one line of JSON from standard input and ends when that closes.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time

from tacdata.errors import DeviceError, TacdataError
from tacdata.label_farm.ledger.ledger import owner_name
from tacdata.label_farm.remote.client import Client
from tacdata.label_farm.remote.desk import RemoteDesk
from tacdata.label_farm.workers.worker import BROKEN, Worker, beat, work

AGAIN_SECONDS = 2.0


def main() -> int:
    """Work until standard input closes; return the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    request = json.loads(sys.stdin.readline())
    client = Client(request["url"], request["token"])

    def desk() -> RemoteDesk:
        return RemoteDesk(client, owner_name(), request["device"])

    remote_desk = desk()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    seconds = _enter(remote_desk)
    threading.Thread(target=beat, args=(desk, seconds), daemon=True).start()
    worker = Worker(remote_desk, request["factory"], strict=False)
    while True:
        try:
            return work(worker)
        except DeviceError as error:  # the line is cut: jobs in work are claimed again by another worker
            print(error, file=sys.stderr)
            time.sleep(AGAIN_SECONDS)
            _enter(remote_desk)
        except TacdataError as error:
            print(error, file=sys.stderr)
            return BROKEN


def _enter(desk: RemoteDesk) -> float:
    while True:
        try:
            return desk.enter()
        except DeviceError as error:
            print(error, file=sys.stderr)
            time.sleep(AGAIN_SECONDS)


def _end_with_parent() -> None:
    sys.stdin.read()
    # Not sys.exit, which would end this thread alone.
    os._exit(0)


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)
