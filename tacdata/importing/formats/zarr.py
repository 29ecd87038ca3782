"""Zarr stores, versions 2 and 3, such as those of Open-X-Tactile (FTP-1): a folder of arrays that share their rows."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.formats.npz import rows_of
from tacdata.importing.formats.source_format import SourceFormat, refuse_growth
from tacdata.importing.mapping import ReadOptions
from tacdata.importing.source_table import SourceTable

DESCRIBED = (".zarray", ".zattrs", ".zgroup", "zarr.json")
"""Files that hold no chunk."""
BLOSC_HEADER = 16
"""Bytes at a chunk's beginning; the last four say its length."""
ENDS = "meta/episode_ends"
"""Array with the row after each episode's last."""
USUAL = 0.99
"""Quantile of the steps between rows up to which a step is usual [1]."""
WIDEST = 4096
"""Values a row above which an array holds images, and no channels."""


class Zarr(SourceFormat):
    """Arrays by name, without ``data/``; a column ``episode`` counts from 0 where the store has the ends of episodes.

    Rows are time: the first axis of an array. The other axes become columns of a table.
    """

    endings = (".zarr",)

    def read(self, path: Path, options: ReadOptions) -> SourceTable:
        """Read the arrays; images are left out and named. See the base class."""
        import zarr

        if not path.is_dir():
            raise FormatError(f"{path} is no folder", "a folder with arrays", "unpack it, or give another ending")
        arrays: dict[str, np.ndarray] = {}
        notes: list[str] = []
        units: dict[str, str] = {}
        # Groups may lack a description of their own, so arrays are looked for and not asked of them.
        second = {described.parent for described in path.rglob(".zarray")}
        third = {file.parent for file in path.rglob("zarr.json") if '"array"' in file.read_text()}
        for folder in sorted(second | third):
            name = folder.relative_to(path).as_posix()
            array = zarr.open_array(str(folder), mode="r")
            if int(np.prod(array.shape[1:])) > WIDEST:
                shape = " x ".join(map(str, array.shape[1:]))
                notes.append(f"{path.name}: {name} of {shape} values a row is left out")
                continue
            refuse_growth(path, float(math.prod(array.shape)) * array.dtype.itemsize)
            _refuse_cut_chunks(folder)
            values = np.asarray(array[:])
            if array.nchunks > array.nchunks_initialized:
                values, words = _without_lost(array, folder, values)
                notes.append(f"{path.name}: {name}: {words}")
            values, unit = by_attributes(values, dict(array.attrs))
            units |= {name.removeprefix("data/"): unit} if unit else {}
            arrays[name] = np.char.strip(values) if values.dtype.kind == "U" else values
        ends = arrays.pop(ENDS, None)
        columns = {
            name.removeprefix("data/"): values for name, values in arrays.items() if not name.startswith("meta/")
        }
        if ends is not None and len(ends):
            columns["episode"] = np.searchsorted(ends, np.arange(int(ends[-1])), side="right")
        table = rows_of(path, columns, options)
        return replace(table, units={**units, **table.units}, notes=(*notes, *table.notes))


def by_attributes(values: np.ndarray, attributes: dict[str, Any]) -> tuple[np.ndarray, str]:
    """Return an array's values by its attributes, and its unit: fill value, scale and offset as netCDF has them.

    "milliseconds since 2026-01-31" is the unit milliseconds.
    """
    unit = str(attributes.get("units") or attributes.get("unit") or "").partition(" since ")[0]
    named = {"_FillValue", "missing_value", "scale_factor", "add_offset"} & set(attributes)
    if values.dtype.kind not in "iuf" or not named:
        return values, unit
    result = values.astype(float)
    for fill in (attributes.get("_FillValue"), attributes.get("missing_value")):
        if isinstance(fill, (int, float)):
            result[values == fill] = np.nan
    return result * float(attributes.get("scale_factor", 1.0)) + float(attributes.get("add_offset", 0.0)), unit


def _without_lost(array: Any, folder: Path, values: np.ndarray) -> tuple[np.ndarray, str]:
    """Return an array's values with NaN for those of chunks that are not there, and how many chunks that are, as words.

    A store leaves out chunks that hold the fill value alone. Where the neighbouring rows are within a usual step of it,
    the values stay.
    """
    if values.dtype.kind not in "biuf" or array.shards is not None:
        return values, f"some of {array.nchunks} chunks are not there; {array.fill_value} is taken for their values"
    result, lost, empty = values.astype(float), 0, 0
    step = np.quantile(np.abs(np.diff(result, axis=0)), USUAL) if len(result) > 1 else 0.0
    for place in np.ndindex(*(-(-size // chunk) for size, chunk in zip(array.shape, array.chunks, strict=True))):
        names = [str(number) for number in place]
        spelled = ("/".join(("c", *names)), ".".join(("c", *names)), ".".join(names), "/".join(names))
        if any((folder / name).is_file() for name in spelled):
            continue
        block = tuple(slice(k * n, (k + 1) * n) for k, n in zip(place, array.chunks, strict=True))
        ends = [block[0].start - 1, block[0].stop]
        neighbours = np.array([values[(row, *block[1:])].ravel() for row in ends if 0 <= row < len(values)])
        if neighbours.size and (np.abs(neighbours - array.fill_value) <= step).all():
            empty += 1
            continue
        result[block], lost = np.nan, lost + 1
    words = f"{lost} of {array.nchunks} chunks are not there; their values are missing" * bool(lost)
    more = f"{empty} chunks are left out by the store, as they hold {array.fill_value} alone" * bool(empty)
    return (result if lost else values), "; ".join(filter(None, (words, more)))


def _refuse_cut_chunks(folder: Path) -> None:
    """Refuse chunks that are shorter than they say: Blosc decompresses them to anything.

    Raises:
        FormatError: Naming the first.
    """
    described = next(file for file in (folder / ".zarray", folder / "zarr.json") if file.is_file()).read_text()
    if '"blosc"' not in described or "sharding" in described:
        return
    for chunk in sorted(file for file in folder.rglob("*") if file.is_file() and file.name not in DESCRIBED):
        data = chunk.read_bytes()
        has_header, stated = len(data) >= BLOSC_HEADER, int.from_bytes(data[12:16], "little")
        if not has_header or stated != len(data):
            fault = f"{len(data)} bytes" + f" in place of {stated}" * has_header
            raise FormatError(f"{chunk}: a damaged chunk, {fault}", "whole chunks", "copy the store again")
