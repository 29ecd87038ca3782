"""Errors for a person in three parts: the given value, the allowed ones, the remedy."""

from __future__ import annotations

import errno
from enum import IntEnum


class Exit(IntEnum):
    """How a verb ends: the one table of exit codes (docs/reference/exit_codes.md)."""

    meaning: str
    """Meaning of the code, for a script."""

    def __new__(cls, code: int, meaning: str) -> Exit:
        """Make a member of its code and its meaning."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member

    DONE = 0, "The task is done."
    UNFIT = 1, "It was looked at, and the answer is no: a recording is unfit, or a robot cannot follow."
    USAGE = 2, "The command or its arguments do not fit together."
    FORMAT = 3, "A file or stream does not fit its schema."
    DEVICE = 4, "A device is missing, silent, or in a state that forbids the action."
    SOLVE = 5, "A simulation cannot be set up, or did not reach equilibrium."
    PACKAGE = 6, "A package is missing that an extra of the install brings."
    INTERRUPTED = 130, "Ctrl-C ended it; finished parts are kept."


class TacdataError(Exception):
    """Base class of every error that is meant for a person.

    Args:
        given: The value found or asked for, with its value and unit, naming the object as the user knows it.
        allowed: Accepted values.
        remedy: The next thing to do.
    """

    exit_code: int = Exit.UNFIT

    def __init__(self, given: str, allowed: str, remedy: str) -> None:
        self.given, self.allowed, self.remedy = given, allowed, remedy
        super().__init__(given, allowed, remedy)

    def __str__(self) -> str:
        """Return the three parts, a line each."""
        return f"{self.given}\n  allowed: {self.allowed}\n  next:    {self.remedy}"


class UsageError(TacdataError):
    """The command or its arguments do not fit together."""

    exit_code = Exit.USAGE


class FormatError(TacdataError):
    """A file or stream does not match its schema."""

    exit_code = Exit.FORMAT


class DeviceError(TacdataError):
    """A device is missing, silent or in a state without this action."""

    exit_code = Exit.DEVICE


class SolveError(TacdataError):
    """A simulation cannot be set up or did not reach equilibrium."""

    exit_code = Exit.SOLVE


class PackageError(TacdataError):
    """A package of an extra of the install is missing (`tacdata.extras`)."""

    exit_code = Exit.PACKAGE


WRITABLE = "a folder that may be written, on a disk with room"
REFUSALS = {
    errno.EACCES: (WRITABLE, "choose another folder, or change its permissions"),
    errno.EPERM: (WRITABLE, "choose another folder, or change its permissions"),
    errno.EROFS: (WRITABLE, "choose a folder on a disk that is not read-only"),
    errno.ENOSPC: (WRITABLE, "make room, or choose a folder on another disk"),
    errno.EDQUOT: (WRITABLE, "make room within the quota, or choose a folder on another disk"),
    errno.EISDIR: ("the path of a file", "name a file in that folder"),
    errno.ENOTDIR: ("a folder on every part of the path but the last", "check the path"),
    errno.EEXIST: ("a path that is not taken", "choose another name"),
    errno.ENOENT: ("a path that exists", "check the path; make the folder first if it is to be written to"),
    errno.ENAMETOOLONG: ("a shorter name", "choose a shorter name"),
    errno.EMFILE: ("fewer open files", "raise the limit of open files (ulimit -n)"),
    errno.EFBIG: (
        "a file that the disk can hold",
        "make room, raise the limit of file sizes (ulimit -f), or choose a disk for larger files (FAT holds 4 GB)",
    ),
    errno.ESTALE: ("a drive that answers", "mount the network drive again, or choose a local disk"),
    errno.ENOTCONN: ("a drive that answers", "connect the drive again, or choose a local disk"),
    errno.ETIMEDOUT: ("a drive that answers", "connect the drive again, or choose a local disk"),
    errno.EHOSTDOWN: ("a drive that answers", "connect the drive again, or choose a local disk"),
    errno.ENODEV: ("a drive that answers", "connect the drive again, or choose a local disk"),
    errno.ENXIO: ("a drive that answers", "connect the drive again, or choose a local disk"),
    errno.ENOTEMPTY: ("a folder that nobody else writes to", "choose another name, or wait for the other command"),
    errno.EBUSY: ("a file that nobody else has open", "close the program that uses it"),
    errno.ETXTBSY: ("a file that nobody else has open", "close the program that uses it"),
    errno.ELOOP: ("a link that ends at a file", "check the link"),
    errno.EINVAL: ("operations that the drive supports", "choose a local disk"),
    errno.ENOTSUP: ("operations that the drive supports", "choose a local disk"),
    errno.EIO: ("a disk without faults", "copy its files to another disk and check this one"),
}
"""Error number of the operating system for a file -> what is allowed, remedy."""


def refused_by_system(error: OSError) -> DeviceError | None:
    """Return an error of the file system in words; None for those that are none of a file."""
    if error.errno not in REFUSALS:
        return None
    allowed, remedy = REFUSALS[error.errno]
    # A renaming names two files.
    paths = " to ".join(str(path) for path in (error.filename, error.filename2) if path is not None)
    return DeviceError(f"{paths or 'a file'}: {error.strerror}", allowed, remedy)
