"""Locks of files: not every drive has them."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

from tacdata.errors import UsageError

WITHOUT_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL}
"""How drives refuse to lock a file."""


def refuse_without_locks(path: Path) -> None:
    """Refuse a drive that locks no files: SQLite would wait for minutes for a lock that never comes.

    Raises:
        UsageError: With the way out.
    """
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows locks files on every drive
        return
    probe = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with probe.open("wb") as stream:
            fcntl.lockf(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in WITHOUT_LOCKS:
            raise UsageError(
                f"{path.parent}: its drive locks no files ({error.strerror})",
                "a drive that locks files, as a local disk",
                "keep the store on a local disk (--store FOLDER)",
            ) from None
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
