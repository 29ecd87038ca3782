"""One table in every format that is read, for tests of a kind of fault in all of them."""

import json
from pathlib import Path

import numpy as np

NAMES = ("t [s]", "depth [mm]", "c0 [pF]", "c1 [pF]")
"""Columns of `table`."""


def table(presses=2, rate=20.0, seed=0):
    """Return times [s], depths [mm] and two channels [pF] of presses of 1.2 mm, shape (rows, 4)."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum([0.0, 1.0, 1.0, 1.0, 1.0, 1.0] * presses)
    path = [0.0, 0.0, 1.2, 1.2, 0.0, 0.0] * presses
    time = np.arange(0, knots[-1], 1 / rate)
    depth = np.interp(time, knots, path)
    channels = 10 + depth[:, None] * [1.0, 0.6] + rng.normal(0, 0.002, (len(time), 2))
    return np.column_stack([time, depth, channels])


def write(folder: Path, form: str, rows: np.ndarray, names=NAMES) -> Path:
    """Write rows in a format; the file's name."""
    path = folder / f"run.{form}"
    bare = [name.split(" [")[0] for name in names]
    columns = {name: rows[:, k] for k, name in enumerate(bare)}
    if form == "csv":
        lines = [",".join(names), *(",".join(f"{value:.6f}" for value in row) for row in rows)]
        path.write_text("\n".join(lines) + "\n")
    elif form == "xlsx":
        import openpyxl

        book = openpyxl.Workbook()
        for row in (names, *rows.tolist()):
            book.active.append(row)
        book.save(path)
    elif form == "parquet":
        import pyarrow as pa
        from pyarrow import parquet

        parquet.write_table(pa.table(columns), path)
    elif form == "npz":
        np.savez(path, **columns)
    elif form == "mat":
        from scipy.io import savemat

        savemat(path, columns)
    elif form == "jsonl":
        path.write_text("".join(json.dumps(dict(zip(bare, row, strict=True))) + "\n" for row in rows.tolist()))
    elif form == "json":
        path.write_text(json.dumps({name: values.tolist() for name, values in columns.items()}))
    elif form == "zarr":
        import zarr

        group = zarr.open_group(str(path), mode="w")
        for name, values in columns.items():
            group.create_array(name, data=values, chunks=(20,))
    elif form == "h5":
        import h5py

        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file[name] = values
    elif form == "tdms":
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(path) as file:
            file.write_segment([ChannelObject("run", name, values) for name, values in columns.items()])
    return path


FORMS = ("csv", "xlsx", "parquet", "npz", "mat", "jsonl", "json", "zarr", "h5", "tdms")


def mapping(folder: Path, path: Path, **changes) -> Path:
    """Write the mapping of `table`; keys of `changes` are added."""
    import yaml

    document = {
        "version": "1.3",
        "name": "bench",
        "files": {"run": {"path": path.name, "time": {"column": "t", "unit": "s"}}},
        "sensor": {"name": "two"},
        "taxels": {"file": "run", "columns": ["c0", "c1"], "unit": "pF"},
        "position": {"file": "run", "depth": {"column": "depth", "unit": "mm"}},
        "indenter": {"shape": "sphere", "radius": 3.0},
        **changes,
    }
    target = folder / "mapping.yaml"
    target.write_text(yaml.safe_dump(document))
    return target
