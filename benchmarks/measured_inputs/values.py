"""Kinds 3 and 4: values that mean none, and units that a file states in its own way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from truth import FIRST_STAMP, NAMES, measured, presses, texts, write

HOLES = (30, 31, 140, 141, 242)
"""Rows of cells without a value."""


def _with_cells(folder: Path, *words: str) -> None:
    cells = texts(presses())
    for number, row in enumerate(HOLES):
        cells[row][2] = words[number % len(words)]
    write(folder, cells)


@measured(3)
def words_of_msvc(folder: Path) -> None:
    """An old C library's -1.#IND, 1.#QNAN and 1.#INF: five cells are missing."""
    _with_cells(folder, "-1.#IND", "1.#QNAN", "1.#INF00")


@measured(3, needed="missing|hold no number")
def words_of_meters(folder: Path) -> None:
    """Over, Err, N.C. and --- in five cells: missing and counted."""
    _with_cells(folder, "Over", "Err", "N.C.", "-----")


@measured(3, needed="missing|hold no number")
def limits_of_meters(folder: Path) -> None:
    """Limits, >9.99 and <0.01, in five cells: missing and counted."""
    _with_cells(folder, ">9.99", "<0.01")


@measured(3, needed="missing|no value|codes?")
def fill_of_netcdf(folder: Path) -> None:
    """9.96921e+36, the fill value of netCDF, in five cells: missing and counted."""
    _with_cells(folder, "9.96921e+36")


@measured(3, needed="missing|no value|codes?")
def fill_of_masks(folder: Path) -> None:
    """-3.4e38, a GIS's no data, and 1e20, a masked array's, in a .npz: missing and counted."""
    rows = presses()
    rows[HOLES[:3], 2], rows[HOLES[3:], 3] = -3.4028234663852886e38, 1e20
    np.savez(folder / "run.npz", t=rows[:, 0], depth=rows[:, 1], c0=rows[:, 2], c1=rows[:, 3])


@measured(3, told="scale_factor|packed|attribute")
def packed_store(folder: Path) -> None:
    """A store's packed integers with scale_factor, add_offset and _FillValue (xarray): 10 to 11.2 pF, or told."""
    import zarr

    rows = presses()
    group = zarr.open_group(str(folder / "run.zarr"), mode="w")
    group.create_array("t", data=rows[:, 0]).attrs["units"] = "s"
    group.create_array("depth", data=rows[:, 1]).attrs["units"] = "mm"
    for number in range(2):
        packed = np.rint((rows[:, 2 + number] - 10) / 1e-4).astype(np.int16)
        if not number:
            packed[list(HOLES)] = -32768
        array = group.create_array(f"c{number}", data=packed)
        array.attrs.update({"scale_factor": 1e-4, "add_offset": 10.0, "_FillValue": -32768, "units": "pF"})


@measured(3, needed="missing|no value|codes?|rail|converter", aligned=False)
def rail_in_parquet(folder: Path) -> None:
    """16-bit counts with 65535 where nothing came, in Parquet: missing and counted."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = presses()
    counts = np.rint(rows[:, 2:] * 100).astype(np.uint16)
    counts[list(HOLES), 0] = 65535
    parquet.write_table(pa.table({"t": rows[:, 0], "depth": rows[:, 1], "c0": counts[:, 0], "c1": counts[:, 1]}),
                        folder / "run.parquet")  # fmt: skip


@measured(3)
def texts_in_parquet(folder: Path) -> None:
    """Numbers as texts in Parquet, some of them empty: numbers."""
    import pyarrow as pa
    from pyarrow import parquet

    cells = np.array(texts(presses()))
    cells[list(HOLES), 2] = ""
    parquet.write_table(
        pa.table({n.split()[0]: cells[:, k].tolist() for k, n in enumerate(NAMES)}), folder / "run.parquet"
    )


@measured(3, needed="same|repeat|stand|old|stuck|constant")
def held_while_down(folder: Path) -> None:
    """A repeated last value while the link is down for 3 s, all channels: told."""
    rows = presses()
    rows[140:200, 2:] = rows[140, 2:]
    write(folder, rows)


@measured(4, told="unit")
def since_a_date(folder: Path) -> None:
    """A store's time in 'milliseconds since 2026-11-29' by its attributes: 20 Hz."""
    import zarr

    rows = presses()
    group = zarr.open_group(str(folder / "run.zarr"), mode="w")
    group.create_array("time", data=np.rint(rows[:, 0] * 1000).astype(np.int64)).attrs.update(
        {"units": "milliseconds since 2026-11-29 12:00:00", "calendar": "proleptic_gregorian"}
    )
    for number, (name, unit) in enumerate((("depth", "um"), ("c0", "pF"), ("c1", "pF")), 1):
        group.create_array(name, data=rows[:, number] * (1000 if number == 1 else 1)).attrs["units"] = unit


@measured(4, told="unit|fast|mm/s")
def units_of_fields(folder: Path) -> None:
    """Units of columns in the fields' metadata of Parquet, key units: 1.2 mm of um, 20 Hz of ms."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = presses() * [1000, 1000, 1, 1]
    fields = [pa.field(n, pa.float64(), metadata={"units": u})
              for n, u in (("t", "ms"), ("depth", "um"), ("c0", "pF"), ("c1", "pF"))]  # fmt: skip
    parquet.write_table(pa.table([pa.array(c) for c in rows.T], schema=pa.schema(fields)), folder / "run.parquet")


@measured(4, told="unit|fast|mm/s")
def unit_in_format(folder: Path) -> None:
    """A depth in um whose unit only the number format of its Excel cells shows: 1.2 mm, told or refused."""
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["time", "depth", "c0 [pF]", "c1 [pF]"])
    for row in (presses() * [1, 1000, 1, 1]).tolist():
        book.active.append(row)
        book.active.cell(book.active.max_row, 2).number_format = '0.0" µm"'
    book.save(folder / "run.xlsx")


@measured(4, told="unit")
def units_by_cell(folder: Path) -> None:
    """Cells with units that change as a dashboard scales them (850 µm, 1.05 mm): mm, or refused."""
    cells = texts(presses())
    for row in cells:
        depth = float(row[1])
        row[1] = f"{depth:.3f} mm" if depth >= 1 or depth == 0 else f"{1000 * depth:.0f} µm"
        row[2], row[3] = f"{row[2]} pF", f"{row[3]} pF"
    write(folder, cells, ("Time", "depth", "c0", "c1"))


@measured(4, told="unit")
def force_in_grams(folder: Path) -> None:
    """Forces in gram-force: 0.12 N at the deepest."""
    rows = presses()
    write(folder, np.column_stack([rows, rows[:, 1] * 10.197]), (*NAMES, "Load [gf]"))


@measured(4, told="unit|inch")
def inches_by_sign(folder: Path) -> None:
    """A depth in inches by the sign ": 1.2 mm."""
    rows = presses()
    cells = [[c[0], f"{d / 25.4:.7f}", *c[2:]] for c, d in zip(texts(rows), rows[:, 1], strict=True)]
    write(folder, cells, ("t [s]", '"depth [""]"', *NAMES[2:]))


@measured(4, told="unit")
def three_micros(folder: Path) -> None:
    """Micro as \u03bc (Greek) for time and \u00b5 (sign) for depth, Latin-1 misread as UTF-8 in one: 20 Hz, 1.2 mm."""
    write(folder, presses() * [1e6, 1000, 1, 1], ("t [\u03bcs]", "depth [\u00c2\u00b5m]", *NAMES[2:]))


@measured(4, told="unit")
def table_with_schema(folder: Path) -> None:
    """A table with a schema (fields with units, rows in data): 20 Hz of ms, or refused."""
    rows = presses() * [1000, 1, 1, 1]
    units = (("t", "ms"), ("depth", "mm"), ("c0", "pF"), ("c1", "pF"))
    document = {"schema": {"fields": [{"name": n, "type": "number", "unit": u} for n, u in units]},
                "data": [dict(zip("t depth c0 c1".split(), row, strict=True)) for row in rows.tolist()]}  # fmt: skip
    (folder / "run.json").write_text(json.dumps(document))


@measured(4, told="")
def annotated_rows(folder: Path) -> None:
    """An annotated CSV of a time series database, one row per value: six lines of annotations, 20 Hz."""
    lines = ["#group,false,false,false,false,true", "#datatype,string,long,dateTime:RFC3339,double,string",
             "#default,_result,,,,", ",result,table,_time,_value,_field"]  # fmt: skip
    from datetime import UTC, datetime, timedelta

    begin = datetime.fromtimestamp(FIRST_STAMP, UTC)
    for number, name in enumerate(("depth", "c0", "c1")):
        for row in presses():
            moment = (begin + timedelta(seconds=float(row[0]))).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
            lines.append(f",,{number},{moment},{row[1 + number]:.5f},{name}")
    (folder / "run.csv").write_text("\n".join(lines) + "\n")
