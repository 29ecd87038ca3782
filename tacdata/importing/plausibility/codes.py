"""Numbers that stand for no value: overload codes of instruments, and the rails of a converter."""

import re
from dataclasses import dataclass, replace

import numpy as np

from tacdata.importing.plausibility.wraps import unwrapped
from tacdata.importing.source_table import SourceTable


@dataclass(frozen=True)
class CodePolicy:
    """Criteria for a code. None of it was tuned on data."""

    huge: float = 9e29
    """Size from which a number is no reading in any unit: instruments write 9.9e37, 1e30, 4.44e49 or -1e105."""
    far: float = 1e6
    """Smallest ratio of a code to all readings [1]."""
    few: int = 3
    """Most different numbers that are so far away [count]; readings that rise through the range between are none."""
    bits: tuple[int, ...] = (8, 10, 12, 14, 16, 18, 20, 24, 32)
    """Widths of converters [bit]."""
    run: int = 3
    """Fewest readings at a rail [count]."""
    inside: float = 0.5
    """Largest share of a channel's readings at a rail [1]; a channel that is always there is a flag."""
    apart: float = 3.0
    """Smallest distance of a number that is usual as a code from all readings [their range]."""
    unusual_apart: float = 5.0
    """The same for any other number, which also repeats exactly and stays for few rows [their range]."""
    levels: int = 10
    """Fewest different readings from which numbers can lie apart [count]; a column of fewer tells states."""
    share: float = 0.2
    """Largest share of codes in a column [1]; above it they are the signal."""
    rare: float = 0.01
    """Largest share of numbers far from all others that are called spikes [1]."""
    tight: float = 3.0
    """Largest ratio of numbers of one size [1]."""
    power: float = 0.1
    """Largest distance of the logarithm of a ratio from a power of ten [1]."""
    stays: int = 3
    """Longest run of rows of a code that is no usual one [rows]."""


POLICY = CodePolicy()
NINES = re.compile(r"-?(?:9{3,}(?:\.9*)?|9{2,}\.9{2,})")
"""Numbers that loggers write for no value and displays for an overload: -999, 9999, 99.99, 999.99."""
LIMITS = frozenset(
    2.0**bits - one for bits in (7, 8, 10, 12, 14, 15, 16, 18, 20, 23, 24, 31, 32, 63, 64) for one in (0, 1)
)
"""Sizes of the first and the last numbers of integers and converters."""


def without_codes(
    values: np.ndarray, name: str, *, rails: bool, policy: CodePolicy = POLICY
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return numbers with NaN for codes, and their counts as sentences.

    Args:
        values: Numbers as in the file [any], shape (rows, k).
        name: Their stream, for the sentences.
        rails: Whether they come from a converter, whose largest number is no reading.
        policy: Criteria for a code.
    """
    codes = np.zeros(values.shape, dtype=bool)
    for column in range(values.shape[1]):
        codes[:, column] = _far(values[:, column], policy)
        codes[:, column] |= _isolated(np.where(codes[:, column], np.nan, values[:, column]), policy)
    doubts = []
    if codes.any():
        doubts.append(_counted(values, codes, name, "stand for an overload or for no value"))
    clipped = _at_rail(np.where(codes, np.nan, values), policy) if rails else np.zeros_like(codes)
    if clipped.any():
        doubts.append(_counted(values, clipped, name, "are the largest that its converter has, and so no readings"))
    missing = codes | clipped
    if (stays := _constant(np.where(missing, np.nan, values), policy)).any():
        doubts.append(_counted(values, stays, name, "stay far from all others", "they count as measured"))
    if (shifted := _shifted(np.where(missing, np.nan, values), policy)).any():
        words = "are ten, a hundred or a thousand times the others among which they stand"
        doubts.append(_counted(values, shifted, name, words, "was a decimal sign lost?"))
    if (spikes := _spikes(np.where(missing, np.nan, values), policy)).any():
        doubts.append(_counted(values, spikes, name, "lie far from all others", "they count as measured"))
    return (np.where(missing, np.nan, values) if missing.any() else values), tuple(doubts)


MISSING = "they are missing (trusted: true keeps them)"
"""Fate of numbers that are no readings."""


def _counted(values: np.ndarray, mask: np.ndarray, name: str, words: str, fate: str = MISSING) -> str:
    numbers, counts = np.unique(values[mask], return_counts=True)
    order = np.argsort(-counts)[:3]
    examples = ", ".join(f"{numbers[k]:.6g}" for k in order.tolist())
    return f"{name}: {int(mask.sum())} numbers ({examples}) {words}: {fate}"


def _far(column: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers are codes by their size alone or by their distance from all others, shape (rows,), bool."""
    size = np.abs(column)
    codes = size >= policy.huge
    sizes = np.unique(size[np.isfinite(column) & ~codes & (column != 0)])
    if len(sizes) > policy.few:
        steps = sizes[1:] > policy.far * sizes[:-1]
        if steps[-policy.few :].any():
            place = len(sizes) - 1 - int(np.argmax(steps[::-1]))
            usual = int((size[np.isfinite(column)] <= sizes[place - 1]).sum())
            # Of two groups of numbers the larger group is the signal.
            if 2 * usual > len(column):
                codes |= size >= sizes[place]
    return codes


def _isolated(column: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers lie apart from all readings, with none between, and mean none, shape (rows,), bool."""
    codes = np.zeros(len(column), dtype=bool)
    distinct = np.unique(column[np.isfinite(column)])
    if len(distinct) <= policy.levels:
        return codes
    # Codes are outermost: a few numbers at either end are judged by all others.
    core = distinct[policy.few : -policy.few]
    for sign, outer in ((1, distinct[-policy.few :]), (-1, distinct[policy.few - 1 :: -1])):
        edge = float(core[-1] if sign > 0 else core[0])
        for value in outer.tolist():
            hits = column == value
            usual = bool(NINES.fullmatch(f"{value:.10g}")) or abs(value) in LIMITS
            brief = hits.sum() >= policy.run and _longest(hits) <= policy.stays
            distance = policy.apart if usual else policy.unusual_apart if brief else np.inf
            if sign * (value - edge) > distance * np.ptp(core):
                codes |= hits
            else:
                edge = value
    return codes if codes.mean() <= policy.share else np.zeros_like(codes)


def _constant(values: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers repeat exactly for long and lie apart from all others, as of a cable that came off."""
    constant = np.zeros(values.shape, dtype=bool)
    for number, column in enumerate(values.T):
        distinct = np.unique(column[np.isfinite(column)])
        if len(distinct) <= policy.levels:
            continue
        for value, others in ((distinct[0], distinct[1:]), (distinct[-1], distinct[:-1])):
            hits = column == value
            away = max(others[0] - value, value - others[-1])
            if away > policy.unusual_apart * np.ptp(others) and hits.mean() <= policy.share:
                constant[:, number] |= hits & (_longest(hits) > policy.stays)
    return constant


def _shifted(values: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers are a power of ten times those before and behind them, shape (rows, k), bool.

    A program that took decimal points for signs between thousands leaves such columns.
    """
    shifted = np.zeros(values.shape, dtype=bool)
    for number, column in enumerate(values.T):
        sizes = np.abs(column[np.isfinite(column) & (column != 0)])
        if len(np.unique(sizes)) <= policy.levels:
            continue
        ordered = np.sort(sizes)
        cut = int(np.argmax(ordered[1:] / ordered[:-1]))
        low, high = ordered[: cut + 1], ordered[cut + 1 :]
        power = np.log10(np.median(high) / np.median(low))
        large = np.abs(column) >= high[0]
        fewer = large if len(high) <= len(low) else ~large
        tight = high[-1] < policy.tight * high[0] and low[-1] < policy.tight * low[0]
        whole = power > 0.5 and abs(power - np.rint(power)) < policy.power
        if tight and whole and len(fewer) > 1 and fewer.sum() >= policy.run and _longest(fewer) <= policy.stays:
            shifted[:, number] = large
    return shifted


def _spikes(values: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers stand for a few rows far outside of all others, shape (rows, k), bool."""
    spikes = np.zeros(values.shape, dtype=bool)
    for number, column in enumerate(values.T):
        if np.isfinite(column).sum() <= 1 / policy.rare:
            continue
        low, high = np.nanquantile(column, [policy.rare, 1 - policy.rare])
        away = policy.unusual_apart * (high - low)
        far = (column > high + away) | (column < low - away)
        if high > low and 0 < far.mean() <= policy.rare and _longest(far) <= policy.stays:
            spikes[:, number] = far
    return spikes


def _longest(mask: np.ndarray) -> int:
    """Return the length of the longest run of True [rows]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def table_without_codes(table: SourceTable, names: list[str], name: str) -> tuple[SourceTable, tuple[str, ...]]:
    """Return a table with NaN for codes in some of its columns of numbers, and their counts as sentences."""
    columns, doubts = {}, []
    for column in names:
        values = table.columns.get(column)
        if values is not None and values.ndim == 1 and values.dtype.kind in "fiu":
            numbers, wraps = unwrapped(values.astype(float)[:, None], name, signed=False)
            numbers, counts = without_codes(numbers, name, rails=False)
            columns[column] = numbers[:, 0]
            doubts += [*wraps, *counts]
    return replace(table, columns={**table.columns, **columns}), tuple(dict.fromkeys(doubts))


def _at_rail(values: np.ndarray, policy: CodePolicy) -> np.ndarray:
    """Return which numbers are a converter's largest, shape (rows, k), bool; signed ones have a lower rail, too."""
    finite = values[np.isfinite(values)]
    clipped = np.zeros(values.shape, dtype=bool)
    if not finite.size or (finite != np.rint(finite)).any():
        return clipped
    low, high = float(finite.min()), float(finite.max())
    for bits in policy.bits:
        upper = (2.0**bits - 1,) if low >= 0 else (2.0 ** (bits - 1) - 1,)
        rails = [rail for rail in upper if high == rail]
        if low < 0 and low == -(2.0 ** (bits - 1)):
            rails.append(low)
        for rail in rails:
            hits = values == rail
            share = hits.mean(axis=0)
            clipped |= hits & (share <= policy.inside) & (hits.sum(axis=0) >= policy.run)
    levels = [len(np.unique(column[np.isfinite(column)])) for column in values.T]
    # A flag of a few levels may reach 255, too, and is not clipped.
    return clipped & (np.array(levels) > 2 * policy.bits[0])
