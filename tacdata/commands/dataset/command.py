"""Shared by the verbs of ``tacdata dataset``: numbers of episodes as typed, and printed lines."""

import re
from collections.abc import Collection, Sequence

from tacdata.errors import UsageError

RANGE = re.compile(r"(\d+)(?:-(\d+))?")


def numbers(text: str) -> list[int]:
    """Return numbers of episodes from text such as ``0-4,7``.

    Raises:
        UsageError: If it is no list of numbers and ranges.

    Example:
        >>> from tacdata.commands.dataset.command import numbers
        >>> numbers("0-2,7")
        [0, 1, 2, 7]
    """
    result: list[int] = []
    for part in text.split(","):
        typed = RANGE.fullmatch(part.strip())
        first, last = (int(typed[1]), int(typed[2] or typed[1])) if typed else (1, 0)
        if last < first:
            raise UsageError(
                f"episodes {text!r}", "numbers and ranges from 0 on, such as 0-4,7", "correct the list of episodes"
            )
        result += range(first, last + 1)
    return result


def counted(episodes: Collection[int]) -> str:
    """Return the number of episodes as a phrase."""
    return f"{len(episodes)} episode" + ("s" if len(episodes) != 1 else "")


def lacking(missing: Sequence[int]) -> str:
    """Return how many episodes have no record, as the end of a sentence; "" for none."""
    if not missing:
        return ""
    return f"; {counted(missing)} without a record (first: {missing[0]}): name the dataset that they come from"
