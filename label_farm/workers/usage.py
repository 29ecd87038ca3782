"""A worker process's use of its computer: time of the processor, memory."""

from __future__ import annotations

import os
import socket
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Usage:
    """Totals of one process."""

    processor: float
    """Time of the processor since it began, all threads [s]."""
    memory: int
    """Memory that it holds (resident set) [bytes]."""


def usage_of(process: int) -> Usage | None:
    """Return the use of a process of this computer; None if it has ended or the system has no /proc."""
    try:
        # After the last parenthesis: the name before it may contain blanks and parentheses.
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return None
    # Fields 14 and 15 of proc(5): time in user mode and in the kernel.
    ticks = int(fields[11]) + int(fields[12])
    return Usage(ticks / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE"))


def local_process(owner: str) -> int | None:
    """Return the process of a worker by its name in the ledger; None for one of another computer."""
    host, _, process = owner.partition("#")[0].rpartition("/")
    return int(process) if host == socket.gethostname() and process.isdigit() else None
