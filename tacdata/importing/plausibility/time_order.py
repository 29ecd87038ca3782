"""The order of a clock's times: wraps of a counter undone, restarts cut, rows without a believable time set aside.

Inside a recording time never goes back. A step back of a few intervals is a row that came late; such rows are put in
order. A larger one is the wrap of a counter, a wrong time in a few rows, or a restart, behind which another stretch
begins. Where rows of several recordings alternate, no order can be restored and the file is refused.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.times import NEVER


@dataclass(frozen=True)
class OrderPolicy:
    """Limits of a plausible clock. None was tuned on data: each is a count of rows or intervals."""

    late: float = 5.0
    """Largest step back of a row that came late [usual intervals]."""
    late_share: float = 0.05
    """Largest share of late rows [1]. Above it rows of several recordings alternate."""
    wrong: int = 3
    """Longest run of wrong times ahead of the clock [rows]. A run behind it is longer if all its times are equal."""
    wrap: float = 3.0
    """Largest distance of the rows before and behind a wrap from its limits [usual intervals]."""
    shortest: float = 10.0
    """Fewest rows of a stretch, on average [rows]. Below it rows of several recordings alternate."""
    turned: float = 0.95
    """Smallest share of steps back in a file that begins with its last row [1]."""
    leap_ns: int = 200 * 86_400_000_000_000
    """Smallest step ahead that no measurement has: the clock was set [ns]."""
    coarse: float = 0.2
    """Largest share of rows that repeat a time [1]. Above it the clock is too coarse for them."""


POLICY = OrderPolicy()
BITS = (15, 16, 24, 32)
"""Widths of counters that wrap [bit]."""
TICKS = {1_000: "microseconds", 1_000_000: "milliseconds"}
"""Ticks that boards count, as micros() and millis() do [ns]."""
COUNTED = 8
"""Width of the narrowest counter of rows [bit]."""
SECONDS_OF_A_YEAR = 31_557_600.0
DAY_NS = 86_400_000_000_000
"""After a day the seconds since midnight begin again, and after seven those of satellites [ns]."""


@dataclass(frozen=True)
class TimeOrder:
    """Times that never go back inside a stretch."""

    stretches: tuple[np.ndarray, ...]
    """Row numbers of each stretch in the order of time [count], shape (n,) each."""
    time_ns: np.ndarray
    """Time of each row [ns], shape (rows,), int64; wraps undone."""
    notes: tuple[str, ...]
    """Repairs, cuts and rows set aside, as sentences."""
    steps_back: tuple[str, ...] = ()
    """The row and the size of each step back at which a stretch ends, as words."""


def time_order(time_ns: np.ndarray, where: str, *, tick_ns: float = 0.0, policy: OrderPolicy = POLICY) -> TimeOrder:
    """Return the rows of a clock in stretches in which time never goes back.

    Args:
        time_ns: Time of each row [ns], shape (rows,), int64; `NEVER` where there is none.
        where: The file and its clock, for notes and errors.
        tick_ns: One step of the clock's numbers [ns]; 0 for a clock that never wraps, as Unix time.
        policy: The limits.

    Raises:
        FormatError: If time goes back so often that rows of several recordings alternate.
    """
    rows = np.flatnonzero(time_ns != NEVER)
    times = time_ns[rows]
    notes = [f"{where}: {len(time_ns) - len(rows)} rows without a time are left out"] * (len(rows) < len(time_ns))
    rows, times, words = _since_set(rows, times, policy)
    notes += [f"{where}: {words}"] * bool(words)
    steps = np.diff(times)
    if len(steps) and (steps < 0).mean() > policy.turned:
        notes.append(f"{where}: its first row is the latest; the rows are turned")
        rows, times, steps = rows[::-1], times[::-1], -steps[::-1]
    if not (steps < 0).any():
        return TimeOrder((rows,), time_ns, tuple(notes))
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if tick_ns:
        times, words = _unwrapped(times, usual, tick_ns, policy)
        notes += [f"{where}: {words}"] * bool(words)
    believed = _believed(times, usual, policy)
    if not believed.all():
        row = int(rows[~believed][0]) + 1
        notes.append(
            f"{where}: {int((~believed).sum())} rows have a time out of line with the rows about them, the first in "
            f"row {row}; they are left out"
        )
    rows, times = rows[believed], times[believed]
    steps = np.diff(times)
    cuts = np.flatnonzero(steps < -policy.late * usual) + 1
    late_rows = int((steps < 0).sum()) - len(cuts)
    if (back := np.flatnonzero(steps < 0)).size and (
        late_rows > max(policy.late_share * len(rows), 1) or (len(cuts) > 1 and len(rows) < policy.shortest * len(cuts))
    ):
        raise _alternating(rows, times, back, where)
    if late_rows:
        notes.append(f"{where}: {late_rows} rows came late by less than {policy.late:g} intervals and are put in order")
    ordered = np.array(time_ns)
    ordered[rows] = times
    edges = [0, *cuts.tolist(), len(rows)]
    # Stable: rows of one time stay in the order of the file.
    stretches = tuple(rows[a:b][np.argsort(times[a:b], kind="stable")] for a, b in pairwise(edges))
    back_words = tuple(_step_back(rows, times, cut) for cut in cuts.tolist())
    if back_words:
        listing = "; ".join(back_words[:3]) + f" and {len(back_words) - 3} times more" * (len(back_words) > 3)
        notes.append(
            f"{where}: time goes back {listing}: a clock that was set back or began again. What follows is a recording "
            "of its own"
        )
    return TimeOrder(stretches, ordered, tuple(notes), back_words)


def _since_set(rows: np.ndarray, time_ns: np.ndarray, policy: OrderPolicy) -> tuple[np.ndarray, np.ndarray, str]:
    """Return the rows of the larger side of a step by years, their times [ns], and the others in words.

    A clock that begins at 1970 or 2000 is set later, in the middle of a log.
    """
    leaps = np.flatnonzero(np.diff(time_ns) > policy.leap_ns) + 1
    # A clock is set once; several leaps mean something else.
    if len(leaps) != 1:
        return rows, time_ns, ""
    cut = int(leaps[0])
    before = 2 * cut <= len(rows)
    years = float(time_ns[cut] - time_ns[cut - 1]) / 1e9 / SECONDS_OF_A_YEAR
    kept = slice(cut, None) if before else slice(cut)
    words = (
        f"time goes ahead by {years:.3g} years in row {int(rows[cut]) + 1}, as of a clock that is set: the "
        f"{cut if before else len(rows) - cut} rows {'before' if before else 'from there on'} are left out"
    )
    return rows[kept], time_ns[kept], words


def _step_back(rows: np.ndarray, time_ns: np.ndarray, cut: int) -> str:
    size = (time_ns[cut - 1] - time_ns[cut]) / 1e9
    return f"by {size:.6g} s in row {int(rows[cut]) + 1}"


def _alternating(rows: np.ndarray, time_ns: np.ndarray, back: np.ndarray, where: str) -> FormatError:
    return FormatError(
        f"{where}: time goes back {len(back)} times in {len(rows)} rows, first "
        f"{_step_back(rows, time_ns, int(back[0]) + 1)}",
        "times that grow inside a recording",
        "if rows of several machines or recordings alternate, name the column that numbers them: trials: "
        "{column: NAME}; else give another time column",
    )


def _unwrapped(time_ns: np.ndarray, usual: float, tick_ns: float, policy: OrderPolicy) -> tuple[np.ndarray, str]:
    """Return times [ns] with the wraps of a counter undone, and the wrap in words; "" without one.

    A wrap leads from the counter's upper limit to its lower one. A restart hardly ever begins there.
    """
    steps = np.diff(time_ns)
    back = np.flatnonzero(steps < -policy.late * usual)
    if not len(back):
        return time_ns, ""
    near = policy.wrap * usual
    for span, name in _spans(tick_ns, counts=usual == tick_ns).items():
        # Counters are unsigned or signed, so they wrap to 0 or to minus half of the span.
        for low in (0.0, -span / 2):
            inside = time_ns.min() >= low and time_ns.max() < low + span
            ends = (time_ns[back] >= low + span - near) & (time_ns[back + 1] <= low + near)
            if not inside or not ends.any() or not (-steps[back] > span / 2).all() or 2 * ends.sum() < len(ends):
                continue
            turns = np.zeros(len(time_ns))
            turns[back + 1] = 1
            lifted = time_ns + (np.cumsum(turns) * span).round().astype(np.int64)
            return lifted, f"its counter wraps at {name} in row {back[0] + 2}" + (
                f" and {len(back) - 1} times more" if len(back) > 1 else ""
            ) + "; the times are continued"
    return time_ns, ""


def _spans(tick_ns: float, *, counts: bool) -> dict[float, str]:
    """Return the spans after which counters wrap [ns], each with its name; ``counts``: a tick is a row."""
    ticks = {tick_ns: "steps"} | {float(tick): name for tick, name in TICKS.items()}
    narrow = {tick_ns * 2.0**COUNTED: f"2^{COUNTED} rows"} if counts else {}
    return (
        {tick * 2.0**bits: f"2^{bits} {name}" for tick, name in ticks.items() for bits in BITS}
        | narrow
        | {float(DAY_NS): "midnight", 7.0 * DAY_NS: "the end of a week"}
    )


def _believed(time_ns: np.ndarray, usual: float, policy: OrderPolicy) -> np.ndarray:
    """Return which rows have a time in line with the rows before and behind them, shape (rows,), bool."""
    believed = np.ones(len(time_ns), dtype=bool)
    for cut in (np.flatnonzero(np.diff(time_ns) < -policy.late * usual) + 1).tolist():
        if not believed[cut - 1] or not believed[cut]:
            continue
        first = cut - 1
        while first > 0 and cut - first < policy.wrong and time_ns[first - 1] > time_ns[cut]:
            first -= 1
        previous = time_ns[first - 1] if first else None
        if previous is not None and 0 <= time_ns[cut] - previous <= (cut - first + 1 + policy.late) * usual:
            believed[first:cut] = False
            continue
        last = cut
        while last < len(time_ns) and time_ns[last] < time_ns[cut - 1]:
            if last - cut >= policy.wrong and time_ns[last] != time_ns[cut]:
                break
            last += 1
        else:
            constant = (time_ns[cut:last] == time_ns[cut]).all()
            if constant or last < len(time_ns):
                believed[cut:last] = False
    return believed


def spread(time_ns: np.ndarray, policy: OrderPolicy = POLICY) -> tuple[np.ndarray, int]:
    """Return times [ns] in order with rows of one time spread evenly up to the next, and how many there were.

    So does a clock that counts whole seconds. Few rows of one time are left as they are: a logger wrote them twice.
    """
    steps = np.diff(time_ns)
    shared = int((steps == 0).sum())
    if shared <= policy.coarse * len(time_ns) or not (steps > 0).any():
        return time_ns, 0
    begins = np.flatnonzero(np.concatenate([[True], steps > 0]))
    counts = np.diff(np.append(begins, len(time_ns)))
    widths = np.append(np.diff(time_ns[begins]), int(np.median(np.diff(time_ns[begins]))))
    inside = np.arange(len(time_ns)) - np.repeat(begins, counts)
    return time_ns + np.rint(inside * np.repeat(widths / counts, counts)).astype(np.int64), shared


def moments(
    time_ns: np.ndarray, channel: np.ndarray, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Group the rows of a table with one row per channel by their time.

    Where a channel's times begin again, the groups do, too.

    Args:
        time_ns: Time of each row [ns], shape (rows,).
        channel: Number of each row's channel, shape (rows,), from 0.
        name: The file's name, for notes.

    Returns:
        Stretch and time of each group, shape (groups, 2); its first row; the group of each row; notes.
    """
    stretch = np.zeros(len(time_ns), dtype=np.int64)
    for number in range(int(channel.max(initial=0)) + 1):
        rows = np.flatnonzero(channel == number)
        order = time_order(time_ns[rows], name)
        for count, part in enumerate(order.stretches):
            stretch[rows[part]] = count
    keys = np.stack([stretch, time_ns], axis=1)
    distinct, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    pairs = np.stack([group.ravel(), channel], axis=1)
    twice = len(pairs) - len(np.unique(pairs, axis=0))
    notes = [f"{name}: {twice} readings have the channel and the time of another; the later one counts"] * bool(twice)
    return distinct, first, group.ravel(), notes
