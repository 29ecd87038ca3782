"""MATLAB files: variables, structures and arrays of structures; those of version 7.3 are read as HDF5."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.hdf5 import Hdf5
from tacdata.importing.formats.npz import rows_of, stacked
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable


class Mat(SourceFormat):
    """Variables by name; a structure's fields as ``structure.field``.

    An array of structures becomes one table: its elements below each other, with a column ``element`` that counts
    them from 0, to be named under ``trials`` in the mapping.
    """

    endings = (".mat",)

    def tables(self, path: Path) -> tuple[str, ...]:
        """Return the variables if they are trials: tables or structures, named by number; see the base."""
        try:
            loaded = _loaded(path)
        # So scipy refuses version 7.3, which is HDF5.
        except NotImplementedError:
            return Hdf5().tables(path)
        names = [name for name in loaded if not name.startswith("__")]
        are_trials = all(isinstance(loaded[name], dict) or (np.ndim(loaded[name]) in (2, 3)) for name in names)
        alike = len({re.sub(r"\d+", "#", name) for name in names}) == 1
        return tuple(names) if are_trials and alike and len(names) > 1 else ("",)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the variables; ``table`` in the options selects one. See the base class."""
        try:
            loaded = _loaded(path)
        except NotImplementedError:
            return Hdf5().read(path, options)
        variables = {name: value for name, value in loaded.items() if not name.startswith("__")}
        is_opaque = any(type(value).__name__ == "MatlabOpaque" for value in loaded.values())
        if is_opaque and not any(_flatten(name, value, []) for name, value in variables.items()):
            raise FormatError(
                f"{path} holds an object of MATLAB (a table, timetable, datetime or string), which only MATLAB reads",
                "numbers, texts and structures",
                "in MATLAB: writetable(t, 'name.csv'), or s = table2struct(t, 'ToScalar', true); save('name.mat', 's')",
            )
        if selection := options.table:
            if selection not in variables:
                raise FormatError(
                    f"{path}: no variable {selection}", ", ".join(variables), "correct table in the mapping"
                )
            variables = {selection: variables[selection]}
        arrays: dict[str, np.ndarray] = {}
        lost: list[str] = []
        for name, value in variables.items():
            arrays |= _flatten(name if len(variables) > 1 else "", value, lost)
        table = rows_of(path, arrays, options)
        if lost and not table.rows:
            cell = lost[0] if len(variables) > 1 else next(iter(variables))
            way = f"in MATLAB, for each k: writematrix({cell}{{k}}, sprintf('trial%d.csv', k))"
            raise FormatError(f"{path}: cells of MATLAB: {', '.join(lost)}", "numbers, texts and structures", way)
        notes = [f"{path.name}: neither numbers nor texts, left out: {', '.join(lost)}"] if lost else []
        return replace(table, notes=(*notes, *table.notes))


def _loaded(path: Path) -> dict[str, Any]:
    """Return a file's variables by name.

    Raises:
        NotImplementedError: For a file of version 7.3.
        FormatError: If its variables would fill the memory.
    """
    from scipy.io import loadmat, whosmat

    # `whosmat` reads the directory alone, so a file that would fill the memory is refused before it is loaded.
    refuse_growth(path, sum(8.0 * math.prod(shape) for _, shape, _ in whosmat(path)))
    return loadmat(path, simplify_cells=True)


def _flatten(name: str, value: Any, lost: list[str]) -> dict[str, np.ndarray]:
    """Return the arrays of a variable by name; the names of other contents are added to ``lost``."""
    if isinstance(value, dict):
        fields: dict[str, np.ndarray] = {}
        if signals := _signals(value):
            return {f"{name}.{key}" if name else key: array for key, array in signals.items()}
        for key, inner in value.items():
            fields |= _flatten(f"{name}.{key}" if name else key, inner, lost)
        return fields
    # A cell array may hold structures, columns, or anything.
    if isinstance(value, (list, np.ndarray)) and np.ndim(value) and len(value):
        if all(isinstance(entry, dict) for entry in value):
            return stacked(name, [_flatten("", element, lost) for element in value], lost)
        if _are_columns(value):
            return {name or "array": np.stack([np.asarray(entry, float) for entry in value], axis=1)}
    array = np.asarray(value)
    if array.dtype.hasobject and all(isinstance(entry, str) for entry in array.flat):
        array = array.astype(str)
    if array.dtype.kind in "biufMSU":
        return {name or "array": array}
    lost.append(name or "array")
    return {}


def _signals(value: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the signals of Simulink's structure with time by their labels; {} of another structure."""
    signals = value.get("signals")
    signals = [signals] if isinstance(signals, dict) else signals
    signals = list(signals) if isinstance(signals, list | np.ndarray) else []
    time = np.atleast_1d(np.squeeze(np.asarray(value.get("time", ()))))
    if not signals or not all(isinstance(each, dict) and "values" in each for each in signals) or time.ndim > 1:
        return {}
    arrays = {"time": time}
    for number, each in enumerate(signals):
        values, label = np.asarray(each["values"]), each.get("label")
        if len(np.atleast_1d(values)) != len(time) or values.dtype.kind not in "biuf":
            return {}
        key = label if isinstance(label, str) and label and label not in arrays else f"signal{number}"
        arrays[key] = values
    return arrays


def _are_columns(value: Any) -> bool:
    """Return whether a cell array holds columns of numbers of one length."""
    shapes = {np.shape(entry) for entry in value}
    if not (isinstance(value, np.ndarray) and value.dtype.hasobject) or [len(shape) for shape in shapes] != [1]:
        return False
    return all(isinstance(number, (int, float, np.number)) for entry in value for number in entry)
