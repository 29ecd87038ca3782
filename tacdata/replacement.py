"""Replaces a file as a whole: written under a temporary name, synced to the disk, renamed."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO


@contextmanager
def replacement(path: Path, folder: Path | None = None, settled: bool = True) -> Iterator[BinaryIO]:
    """Yield a stream whose bytes become the file ``path`` when the block ends; until then the old file stays.

    A crash or a full disk leaves the old file or the new one, never a half. If the block raises, nothing is left.

    Args:
        path: The file; its folder is made if it is missing.
        folder: Folder of the unfinished file, on the same file system; by default the file's own, under a hidden name.
        settled: Whether the new name is synced too when the block ends. Without it, a power cut in the next seconds may
            leave the old file.

    Raises:
        OSError: If the disk refuses it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=folder or path.parent, prefix=f".{path.name}." if folder is None else None)
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        with suppress(OSError):  # a drive without permissions, as CIFS or FAT
            os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    if settled:
        settle(path.parent)


WITHOUT_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EPERM, errno.EACCES, errno.EBADF}
"""How drives refuse to sync a folder; the file is whole without it."""


def settle(folder: Path) -> None:
    """Sync a folder's entries to the disk, so that a rename survives a power cut, where the drive can (Unix)."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in WITHOUT_SYNC:
            raise
    finally:
        os.close(handle)
