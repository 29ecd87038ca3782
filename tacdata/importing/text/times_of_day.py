"""Times of day and durations, as texts or as numbers, in seconds."""

import re

import numpy as np

DAY = 86_400.0
"""Length of a day [s]."""


def times_of_day(values: np.ndarray) -> np.ndarray | None:
    """Return seconds since the first midnight [s], shape (n,), of texts like 12:34:56.789; None for other texts.

    Excel shows times as 34:56.7 and begins again every hour: seconds are then counted from the first one.
    """
    texts = [str(text).strip() for text in values.tolist() if text is not None]
    if any(re.fullmatch(DURATION, text) for text in texts) and all(
        re.fullmatch(r"(\d+ days?,? )?-?\d+:\d{2}:\d{2}.*", t) for t in texts
    ):
        return np.array([np.nan if text is None else _duration(str(text)) for text in values.tolist()])
    forms = {
        r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?": 86_400,
        r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?\s*[AaPp]\.?[Mm]\.?": 86_400,
        r"\d{1,2}:\d{2}[.,]\d+": 3600,
    }
    turn = next((turn for form, turn in forms.items() if all(re.fullmatch(form, text) for text in texts)), 0)
    if not texts or not turn:
        return None
    seconds = np.full(len(values), np.nan)
    for row, text in enumerate(values.tolist()):
        if text is not None:
            digits = str(text).strip().rstrip(" .AaMmPp")
            half = str(text).strip()[len(digits) :].lstrip()
            *hours, minutes, tail = digits.replace(",", ".").split(":")
            hour = int(hours[0] if hours else 0)
            hour = hour % 12 + 12 * (half[0] in "Pp") if half else hour
            seconds[row] = 3600 * hour + 60 * int(minutes) + float(tail)
    # A fall by more than half a turn is midnight (or the hour); a smaller one is a row out of order.
    back = np.diff(seconds, prepend=seconds[0]) < -turn / 2
    return seconds + turn * np.cumsum(back)


def digits_of_day(values: np.ndarray) -> np.ndarray | None:
    """Return seconds since the first midnight [s], shape (n,), of numbers like 123456.5 for 12:34:56.5; else None.

    At each full minute such numbers leave out 60 to 99: seconds of another clock would not.
    """
    numbers = values.astype(float)
    known = np.isfinite(numbers)
    whole = numbers[known]
    minutes, seconds = np.divmod(whole, 100)
    if (
        len(whole) < 3
        or whole.min() < 0
        or whole.max() >= 240_000
        or seconds.max() >= 60
        or (minutes % 100 >= 60).any()
    ):
        return None
    steps = np.diff(whole)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    turns = np.flatnonzero(np.diff(minutes))
    if not len(turns) or not 0 < usual < 20:
        return None
    if (seconds[turns] < 60 - 3 * usual).any() or (seconds[turns + 1] > 3 * usual).any():
        return None
    result = np.full(len(numbers), np.nan)
    result[known] = 3600 * (minutes // 100) + 60 * (minutes % 100) + seconds
    back = np.diff(result[known], prepend=result[known][0]) < -DAY / 2
    result[known] += DAY * np.cumsum(back)
    return result


DURATION = (
    r"\d+ days?,? \d+:\d{2}:\d{2}([.,]\d+)?|-\d+:\d{2}:\d{2}([.,]\d+)?|(2[4-9]|[3-9]\d|\d{3,}):\d{2}:\d{2}([.,]\d+)?"
)
"""A time since a start and no time of day: with a sign, with days as pandas writes it, or of more than 24 hours."""


def _duration(text: str) -> float:
    days, _, clock = text.strip().rpartition(" ")
    hours, minutes, seconds = clock.replace(",", ".").lstrip("-").split(":")
    size = DAY * int(days.partition(" ")[0] or 0) + 3600 * int(hours) + 60 * int(minutes) + float(seconds)
    return -size if text.strip().startswith("-") else size
