"""Errors for a person: what was given, what is allowed, what to do next."""

from __future__ import annotations

from enum import IntEnum


class Exit(IntEnum):
    """How a verb ends: the one table of exit codes (docs/reference/exit_codes.md)."""

    meaning: str
    """What the code means, for a script."""

    def __new__(cls, code: int, meaning: str) -> Exit:
        """Make a member of its code and its meaning."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member

    DONE = 0, "What was asked for is done."
    UNFIT = 1, "It was looked at, and the answer is no: a recording is unfit, or a robot cannot follow."
    USAGE = 2, "The command or its arguments do not fit together."
    FORMAT = 3, "A file or stream is not what its schema says."
    DEVICE = 4, "A device is missing, silent, or in a state that forbids the action."
    SOLVE = 5, "A simulation cannot be set up, or did not reach equilibrium."
    PACKAGE = 6, "A package is missing that an extra of the install brings."
    INTERRUPTED = 130, "Ctrl-C ended it; what was finished is kept."


class TacdataError(Exception):
    """Base class of every error that is meant for a person.

    Args:
        given: What was found or asked for, with its value and unit, naming the object as the user knows it.
        allowed: What is accepted.
        remedy: The next thing to do.
    """

    exit_code: int = Exit.UNFIT

    def __init__(self, given: str, allowed: str, remedy: str) -> None:
        self.given, self.allowed, self.remedy = given, allowed, remedy
        super().__init__(f"{given}\n  allowed: {allowed}\n  next:    {remedy}")


class UsageError(TacdataError):
    """The command or its arguments do not fit together."""

    exit_code = Exit.USAGE


class FormatError(TacdataError):
    """A file or stream does not match its schema."""

    exit_code = Exit.FORMAT


class DeviceError(TacdataError):
    """A device is missing, silent or in a state that forbids the action."""

    exit_code = Exit.DEVICE


class SolveError(TacdataError):
    """A simulation cannot be set up or did not reach equilibrium."""

    exit_code = Exit.SOLVE


class PackageError(TacdataError):
    """A package is missing that an extra of the install brings (`tacdata.extras`)."""

    exit_code = Exit.PACKAGE
