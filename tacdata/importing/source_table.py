"""A file's columns, selected as a mapping names them, as numbers in our units."""

import fnmatch
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tacdata.documents import composed
from tacdata.errors import FormatError
from tacdata.importing.mapping import Axis, Quantity, Selector
from tacdata.importing.text.layout import THOUSANDS
from tacdata.importing.units import factor, plain, prefixed, quantity_of, split_unit

INNER = re.compile(r"(.+)\[(\d+)\]")
"""Name of one column of a table: the table's name and a number from 0, as in ``cap[3]``."""
WRITTEN = re.compile(r"[-+]?\d*[.,]?\d+([eE][-+]?\d+)?")
"""A number in a text."""


@dataclass(frozen=True)
class SourceTable:
    """A file's columns."""

    path: Path
    columns: dict[str, np.ndarray]
    """Name -> values as in the file [any], shape (rows,) or (rows, k): float64, int64, or text."""
    units: dict[str, str] = field(default_factory=dict)
    """Name -> unit, where the file gives one."""
    typed: frozenset[str] = frozenset()
    """Columns whose unit is a part of the file's own type, as that of a duration: no mapping overrules it."""
    notes: tuple[str, ...] = ()
    """Remarks on the reading, as sentences."""
    doubts: tuple[str, ...] = ()
    """Values that were left out because they cannot be measurements, as sentences."""
    rate: float = 0.0
    """Rate that the file states outside its columns [Hz]; 0 if it states none."""

    def column(self, name: str) -> np.ndarray:
        """Return a column's values, or one column of a table in it, named ``name[k]`` (from 0).

        Shape (rows,), or (rows, k) for a table.
        """
        if name not in self.columns and (inner := INNER.fullmatch(name)):
            return self.columns[inner[1]][:, int(inner[2])]
        return self.columns[name]

    def inner(self, name: str) -> int:
        """Return the number of columns inside a column: 0 for plain values, k for a table."""
        values = self.columns.get(name)
        return 0 if values is None or values.ndim < 2 else values.shape[1]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return max((len(values) for values in self.columns.values()), default=0)


def select(table: SourceTable, selector: Selector, where: str) -> list[str]:
    """Return the column names that a mapping selects, in its order.

    Args:
        table: The file's columns.
        selector: A name, a number from 0, a range "1-15", a pattern "cap*", one column of an array "cap[3]", several
            "cap[0-7]", or a list of these. In a file of one array numbers are its columns.
        where: Names the place in the mapping in errors.

    Raises:
        FormatError: If there is no such column.
    """
    if isinstance(selector, list):
        selection = [name for entry in selector for name in select(table, entry, where)]
        return list(dict.fromkeys(selection))
    if isinstance(selector, str):
        selector = composed(selector)
    names = list(table.columns)
    if len(names) == 1 and table.inner(names[0]):
        # In a file of one array, numbers in the mapping mean its columns.
        names = [f"{names[0]}[{k}]" for k in range(table.inner(names[0]))]
        if isinstance(selector, str) and selector in table.columns:
            return [selector]
    bare = {name: split_unit(name)[0] for name in names}
    if isinstance(selector, str):
        for candidates in (names, list(bare.values())):
            if selector in candidates:
                return [names[candidates.index(selector)]]
        name, unit = split_unit(selector)
        same = [each for each in names if unit and not unit.isdigit() and bare[each] == name]
        if len(same) == 1:  # the same quantity in another unit, which `unit_of` reads
            return same
        if match := re.fullmatch(r"(\d+)\s*-\s*(\d+)", selector):
            return [name for k in range(int(match[1]), int(match[2]) + 1) for name in select(table, k, where)]
        if selection := _inner(table, selector):
            return selection
        if hits := [name for name in names if fnmatch.fnmatchcase(name, selector)]:
            return hits
    elif 0 <= selector < len(names):
        return [names[selector]]
    left_out = [note for note in table.notes if "left out" in note]
    raise FormatError(
        f"{where}: column {selector!r} is not in {table.path.name}" + (f" ({'; '.join(left_out)})" * bool(left_out)),
        ", ".join(names[:40]) + (f" and {len(names) - 40} more" if len(names) > 40 else ""),
        "correct the column in the mapping (columns count from 0)",
    )


def _inner(table: SourceTable, selector: str) -> list[str]:
    """Return the columns of an array that ``name[k]`` or ``name[a-b]`` means; [] if there is no such array."""
    match = re.fullmatch(r"(.+)\[(\d+)(?:\s*-\s*(\d+))?\]", selector)
    if not match:
        return []
    first, last = int(match[2]), int(match[3] or match[2])
    return [f"{match[1]}[{k}]" for k in range(first, last + 1)] if first <= last < table.inner(match[1]) else []


def single(table: SourceTable, selector: Selector, where: str) -> str:
    """Return the one column that a mapping means; raises FormatError if there are none or several."""
    names = select(table, selector, where)
    if len(names) != 1:
        raise FormatError(f"{where}: {selector!r} means {len(names)} columns", "one column", "name one")
    if width := table.inner(names[0]):
        raise FormatError(
            f"{where}: {selector!r} is an array of {width} columns",
            "one column",
            f"name one of them, {names[0]}[0] to {names[0]}[{width - 1}]",
        )
    return names[0]


def numbers(table: SourceTable, names: list[str], missing: Iterable[float], where: str) -> np.ndarray:
    """Return columns as numbers [as in the file], shape (rows, n), NaN where a value is missing.

    Raises:
        FormatError: If a column holds text.
    """
    parts = []
    for name in names:
        values = table.column(name)
        if values.dtype == object:
            raise _text(table, name, values, where)
        values = values.astype(float)
        parts.append(values[:, None] if values.ndim == 1 else values)
    joined = np.concatenate(parts, axis=1) if parts else np.empty((table.rows, 0))
    joined[~np.isfinite(joined)] = np.nan  # "inf" is how some loggers write an overload: no value either
    for sentinel in missing:
        joined[joined == float(sentinel)] = np.nan
    return joined


def axis(
    table: SourceTable | None, entry: Quantity, unit: str, where: str, missing: Iterable[float] = ()
) -> np.ndarray:
    """Return one quantity in ``unit``, shape (rows,), or shape () if the mapping gives a number.

    Raises:
        FormatError: If the column or its unit is not known.
    """
    if not isinstance(entry, Axis):
        return np.array(float(entry))
    if table is None:
        raise FormatError(f"{where}: a column without a file", "a number, or a file for the column", "add file: NAME")
    name = single(table, entry.column, where)
    source_unit = unit_of(table, name, where, entry.unit) or unit
    values = numbers(table, [name], missing, where)[:, 0]
    values = values * factor(source_unit, unit, where) * entry.scale + entry.offset
    finite = values[np.isfinite(values)]
    if entry.zero and len(finite):
        values = values - {"first": finite[0], "lowest": finite.min(), "highest": finite.max()}[entry.zero]
    return values


def unit_of(table: SourceTable, column: Selector, where: str, given: str = "") -> str:
    """Return the unit of a column, ``given`` by the mapping or by the file; "" if neither gives one.

    Raises:
        FormatError: If the file and the mapping give different units of one quantity.
    """
    name = single(table, column, where)
    base_name = inner[1] if (inner := INNER.fullmatch(name)) and table.inner(inner[1]) else name
    inside = split_unit(base_name)[1]
    stated = table.units.get(base_name) or ("" if inside.isdigit() else inside)
    # The unit belongs to the file's type (a duration), so no mapping can contradict it.
    if base_name in table.typed:
        return stated
    if not given and _differ(stated, inside, where):
        raise FormatError(
            f"{where}: {table.path.name} states {stated} for {base_name}, whose name has the unit {inside}",
            "one unit",
            f"give unit: {stated} or unit: {inside} there in the mapping",
        )
    # Where the file contradicts itself, the mapping decides.
    if given and _differ(given, stated, where) and not (inside and not _differ(given, inside, where)):
        raise _contradiction(table, base_name, stated, given, where)
    return given or stated


def units_of(table: SourceTable, names: list[str], where: str, given: str = "") -> list[str]:
    """Return the unit of each of some columns, by the mapping or the file; "" where neither gives one.

    Raises:
        FormatError: If the mapping's unit is another one of the same quantity.
    """
    units = []
    for name in names:
        inside = split_unit(name)[1]
        stated = table.units.get(name) or ("" if inside.isdigit() else inside)
        if given and not quantity_of(stated) and prefixed(given, stated):
            raise _contradiction(table, name, stated, given, where)
        units.append(plain((given or stated) if table.inner(name) else unit_of(table, name, where, given)))
    return units


def _contradiction(table: SourceTable, name: str, stated: str, given: str, where: str) -> FormatError:
    return FormatError(
        f"{where}: {table.path.name} states {stated} for {name}, and the mapping {given}",
        "one unit",
        "leave unit out of the mapping; where the file is wrong, correct its header in a copy",
    )


def _differ(first: str, second: str, where: str) -> bool:
    """Return whether two units are of one quantity and of different size."""
    ours = quantity_of(first) if first and second else None
    if not ours or quantity_of(second) != ours:
        return False
    return not np.isclose(factor(first, ours, where), factor(second, ours, where))


def _text(table: SourceTable, name: str, values: np.ndarray, where: str) -> FormatError:
    """Return the error of a column of text, which may be numbers in another dress."""
    texts = [str(value).strip() for value in values.tolist() if value is not None]
    example = next((value for value in values.tolist() if value is not None), None)
    fault = f"{where}: column {name} of {table.path.name} holds text, for example {example!r}"
    if texts and sum(bool(THOUSANDS.fullmatch(text)) for text in texts) > len(texts) / 2:
        return FormatError(
            f"{fault}: numbers with a sign between thousands, or with three decimal places, as text",
            "numbers",
            "save it again as numbers, without a sign between thousands",
        )
    if texts and sum(bool(WRITTEN.fullmatch(text)) for text in texts) > len(texts) / 2:
        return FormatError(f"{fault}: numbers as text", "numbers", "save it again as numbers")
    return FormatError(
        fault, "numbers", "name another column, or add the texts that mean no value to the file's missing"
    )
