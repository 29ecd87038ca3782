"""What the user sees when something is wrong: what was given, what is allowed, what to do next."""

from __future__ import annotations


class TacdataError(Exception):
    """Base of every error that is meant for a person.

    Args:
        given: What was found or asked for, with its value and unit, naming the object as the user knows it.
        allowed: What would have been accepted.
        remedy: The next thing to do.
    """

    exit_code = 1

    def __init__(self, given: str, allowed: str, remedy: str) -> None:
        self.given, self.allowed, self.remedy = given, allowed, remedy
        super().__init__(f"{given}\n  allowed: {allowed}\n  next:    {remedy}")


class UsageError(TacdataError):
    """The command or its arguments do not fit together."""

    exit_code = 2


class FormatError(TacdataError):
    """A file or stream is not what its schema says."""

    exit_code = 3


class DeviceError(TacdataError):
    """A device is missing, silent or in a state that forbids the action."""

    exit_code = 4


class SolveError(TacdataError):
    """A simulation cannot be set up or did not reach equilibrium."""

    exit_code = 5
