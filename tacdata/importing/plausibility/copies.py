"""Rows that a logger wrote twice: equal to the row before, or to an earlier one, in every column with the time."""

from dataclasses import dataclass, replace

import numpy as np

from tacdata.importing.source_table import SourceTable


@dataclass(frozen=True)
class CopyPolicy:
    """Criteria for copies. None was tuned on data."""

    share: float = 0.95
    """Smallest share of copies among rows that have the time of the row before [1]; a coarse clock has few."""
    usual: float = 0.5
    """Largest share of rows of another time that equal the row before [1]; readings without noise have more."""


POLICY = CopyPolicy()


def without_copies(table: SourceTable, time: str, policy: CopyPolicy = POLICY) -> SourceTable:
    """Return a table without rows that are copies of the row before, which its doubts count.

    Args:
        table: A file's columns.
        time: The column of its times.
        policy: The criteria.
    """
    if table.rows < 2 or len(table.columns) < 2 or any(len(v) != table.rows for v in table.columns.values()):
        return table
    table = _without_sent_again(table, time, policy)
    same_time = _repeats(table.column(time))
    if not same_time.any():
        return table
    same = np.ones(table.rows, dtype=bool)
    for name, values in table.columns.items():
        if name != time:
            same &= _repeats(values)
    copies = same & same_time
    others = ~same_time[1:]
    if copies.sum() < policy.share * same_time.sum() or (others.any() and same[1:][others].mean() > policy.usual):
        return table
    count, row = int(copies.sum()), int(np.flatnonzero(copies)[0])
    doubt = (
        f"{table.path.name}: {count} rows are copies of the row before, with its time and all of its values, the first "
        f"in row {row + 1}: they are left out"
    )
    columns = {name: values[~copies] for name, values in table.columns.items()}
    return replace(table, columns=columns, doubts=(*table.doubts, doubt))


def _without_sent_again(table: SourceTable, time: str, policy: CopyPolicy) -> SourceTable:
    """Return a table without rows that came before, with their time and all values, as a logger sends them again."""
    clock = table.column(time)
    if clock.dtype == object or not (np.diff(clock.astype(float)) < 0).any():
        return table
    seen: set[bytes] = set()
    again = np.zeros(table.rows, dtype=bool)
    parts = [values.astype(str) if values.dtype == object else values for values in table.columns.values()]
    for row in range(table.rows):
        content = b"".join(values[row].tobytes() for values in parts)
        again[row] = content in seen
        seen.add(content)
    left = clock.astype(float)[~again]
    noise = np.ones(table.rows, dtype=bool)
    for name, values in table.columns.items():
        if name != time:
            noise &= _repeats(values)
    if not again.any() or (np.diff(left) < 0).any() or noise[1:].mean() > policy.usual:
        return table
    doubt = (
        f"{table.path.name}: {int(again.sum())} rows came before, with their time and all of their values, the first "
        f"in row {int(np.flatnonzero(again)[0]) + 1}: they are left out"
    )
    columns = {name: values[~again] for name, values in table.columns.items()}
    return replace(table, columns=columns, doubts=(*table.doubts, doubt))


def _repeats(values: np.ndarray) -> np.ndarray:
    """Return which rows of a column equal the row before, shape (rows,), bool; a missing value equals another."""
    same = np.zeros(len(values), dtype=bool)
    equal = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        equal |= np.isnan(values[1:]) & np.isnan(values[:-1])
    same[1:] = equal if values.ndim == 1 else equal.reshape(len(equal), -1).all(axis=1)
    return same
