"""Splits one set of files into recordings: by a column, by a pause, or by press."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import KnownValue, Mapping, TrialRule
from tacdata.importing.source_table import SourceTable, single


def split_tables(tables: dict[str, SourceTable], mapping: Mapping) -> Iterator[tuple[str, dict[str, SourceTable]]]:
    """Yield the label and the rows of each trial by a column, all rows under "" without such a column.

    A trial is of one specimen: where the channels' file names several, by a column, each has a trial of its own.

    Raises:
        FormatError: If no file has the column.
    """
    trials, pieces = mapping.trials, iter([("", tables)])
    if trials.column is not None:
        pieces = _by_column(tables, trials.column)
    elif trials.change is not None:
        pieces = _by_column(tables, trials.change, counted=True)
    for label, rows in pieces:
        yield from _by_specimen(label, rows, mapping.specimen, mapping.taxels.file)


def _by_specimen(
    label: str, tables: dict[str, SourceTable], specimen: str | KnownValue, read: str
) -> Iterator[tuple[str, dict[str, SourceTable]]]:
    """Yield the parts of a trial that are of one specimen each, by the channels' file ``read``."""
    by_column = isinstance(specimen, KnownValue) and specimen.column != ""
    if not by_column or (specimen.file or next(iter(tables))) != read:
        yield label, tables
        return
    words = _held(_labels(tables[read], specimen.column))
    if len(set(words.tolist()) - {""}) < 2:
        yield label, tables
        return
    for word in dict.fromkeys(words.tolist()):
        yield f"{label} {word}".strip(), tables | {read: _kept(tables[read], words == word)}


def _held(words: np.ndarray) -> np.ndarray:
    """Return words that hold until the next one: some write them only into the first row of a block."""
    rows = np.flatnonzero(words != "")
    if not len(rows):
        return words
    return words[rows[np.maximum(np.searchsorted(rows, np.arange(len(words)), side="right") - 1, 0)]]


def _kept(table: SourceTable, rows: np.ndarray) -> SourceTable:
    return replace(table, columns={name: values[rows] for name, values in table.columns.items()})


def _by_column(
    tables: dict[str, SourceTable], column: str | int, *, counted: bool = False
) -> Iterator[tuple[str, dict[str, SourceTable]]]:
    """Yield the rows of each label of a column; with ``counted``, of each run of rows with one label."""
    named: dict[str, np.ndarray] = {}
    refused = FormatError("no file to split by a column", "one or more", "correct the mapping")
    for alias, table in tables.items():
        try:
            labels = _labels(table, column)
            # Mostly empty cells behind a first label repeat it. A few empty ones are gaps between trials.
            named[alias] = _held(labels) if labels[0] and 2 * (labels == "").sum() > len(labels) else labels
            if counted:
                runs = np.cumsum(np.concatenate([[0], labels[1:] != labels[:-1]]))
                named[alias] = np.array([f"{run} ({label})" for run, label in zip(runs, labels, strict=True)], object)
        except FormatError as error:  # another file may have it
            refused = error
    if not named:
        raise refused
    longest = max(named.values(), key=lambda labels: len(set(labels.tolist())))
    for label in dict.fromkeys(longest.tolist()):
        rows = {alias: labels == label for alias, labels in named.items()}
        if all(mask.any() for mask in rows.values()):
            yield (
                f"{label}",
                {alias: _kept(table, rows[alias]) if alias in rows else table for alias, table in tables.items()},
            )


def _labels(table: SourceTable, column: str | int) -> np.ndarray:
    values = table.column(single(table, column, "trials: column"))
    if values.dtype == object:
        return np.array(["" if value is None else str(value) for value in values.tolist()], dtype=object)
    return np.array([f"{value:g}" if np.isfinite(value) else "" for value in values.astype(float)], dtype=object)


def windows(
    trials: TrialRule, taxels_ns: np.ndarray, path: tuple[np.ndarray, np.ndarray] | None
) -> list[tuple[int, int]]:
    """Return the time intervals of the trials.

    Args:
        trials: The end of a trial.
        taxels_ns: Times of the channels [ns], shape (n,).
        path: Times [ns], shape (m,), and depths [mm], shape (m,), if they are known.

    Returns:
        First time and the one after the last [ns] of each trial.

    Raises:
        FormatError: If nothing is deeper than ``press_above``.
    """
    ends = [int(taxels_ns[0]), int(taxels_ns[-1]) + 1]
    if trials.gap is not None:
        pauses = np.flatnonzero(np.diff(taxels_ns) > trials.gap * 1e9)
        ends[1:1] = [int(taxels_ns[k + 1]) for k in pauses]
    if trials.press_above is not None:
        if path is None:
            raise FormatError("trials: press_above without a position", "a position", "add position, or split by gap")
        time_ns, depth = path
        deep = np.concatenate([[False], depth > trials.press_above, [False]])
        edges = np.flatnonzero(np.diff(deep.astype(np.int8)))
        begins, stops = edges[::2], edges[1::2] - 1
        if not len(begins):
            raise FormatError(
                f"trials: press_above {trials.press_above:g} mm, the deepest is {depth.max():.3f} mm",
                f"less than {depth.max():.3f} mm",
                "correct press_above or the position's zero",
            )
        # Half way between two presses: both keep readings without contact.
        ends[1:1] = [(int(time_ns[b]) + int(time_ns[e])) // 2 for e, b in zip(stops[:-1], begins[1:], strict=True)]
    return [(a, b) for a, b in pairwise(ends) if b > a]
