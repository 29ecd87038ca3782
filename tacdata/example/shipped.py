"""Place of the shipped recording, and a copy to work on."""

from __future__ import annotations

import shutil
from pathlib import Path

from tacdata.errors import DeviceError, UsageError

SESSION = Path(__file__).with_name("session")
"""Files that `.dev/example` recorded and labelled."""
DEEPEST = 1
"""Number of its deepest press."""


def copy_session(target: Path) -> Path:
    """Copy the shipped session to a new folder, labels included.

    Raises:
        UsageError: If the folder exists.
        DeviceError: If the disk refuses it.
    """
    if target.exists():
        raise UsageError(f"{target} exists", "a new folder; nothing is overwritten", "name another one")
    try:
        shutil.copytree(SESSION, target)
    except OSError as error:
        raise DeviceError(
            f"copying the example to {target} failed: {error}",
            "a place to write, on a disk with room",
            "name another folder",
        ) from error
    return target
