"""A label farm as an entry, by the files of its store; nothing is asked of it."""

import os
import re
from pathlib import Path

from tacdata import documents
from tacdata.studio.entry import LabEntry, command, local_minute

LOCK = "service.lock"
"""File of a store that names the service's address and process."""
SERVED = re.compile(r"(http://([\w.:\[\]-]+):(\d+)) \(process (\d+)\)")
OPEN = ("waiting", "planning", "running")
"""States of a submission that is not finished."""


def farm_entry(root: Path, store: Path) -> LabEntry:
    """Return the entry of a farm's store. Raises as `documents.read`."""
    submissions = [documents.read(path, "submission") for path in sorted((store / "submissions").glob("*.json"))]
    pending = [submission for submission in submissions if submission["state"] in OPEN]
    total, done = (sum(submission.get(key, 0) for submission in pending) for key in ("episodes", "labelled"))
    failed = sum(submission.get("failed", 0) for submission in submissions)
    address = running_at(store / LOCK)
    words = f"runs at {address}" if address else "does not run"
    words += f"; {len(pending)} of {len(submissions)} submissions open" if submissions else "; no submissions"
    words += f", {done} of {total} presses labelled" if pending else ""
    start = command("farm", "up", "--root", store.parent.relative_to(root))
    return LabEntry(
        "Label farm",
        store.relative_to(root).as_posix(),
        words,
        "good" if address else "bad" if pending else "",
        faults=(f"{failed} presses without a label",) if failed else (),
        date=local_minute((store / LOCK).stat().st_mtime),
        commands=(command("farm", "status", "--url", address),) if address else (start,),
        running=bool(address),
        address=address,
        share=done / total if total else None,
    )


def running_at(lock: Path) -> str:
    """Return the address of the service that holds a store, on this computer; empty if none runs."""
    match = SERVED.search(lock.read_text(errors="replace"))
    if match is None or os.name != "posix":  # elsewhere the question ends the process
        return ""
    try:
        os.kill(int(match[4]), 0)
    except PermissionError:  # it runs under another account
        pass
    except (OSError, OverflowError):
        return ""
    # An address that listens everywhere is no address to open.
    return f"http://127.0.0.1:{match[3]}" if match[2] == "0.0.0.0" else match[1]
