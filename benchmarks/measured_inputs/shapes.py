"""Kinds 6, 7 and 8: arrays, folders and joins; files with a bad stretch; columns that are no channels."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from truth import NAMES, measured, presses, texts, write


@measured(6, told="axis|transpose")
def arrays_lying(folder: Path) -> None:
    """Two arrays of several rows each, time first (3 x n and 2 x n), in one .npz."""
    rows = presses()
    np.savez(folder / "run.npz", capacitance=rows[:, [0, 2, 3]].T, position=rows[:, :2].T)


@measured(6, told="axis|transpose|columns")
def named_axes(folder: Path) -> None:
    """A store of one array (channel, time) with the names of its axes."""
    import zarr

    group = zarr.open_group(str(folder / "run.zarr"), mode="w")
    group.create_array("data", data=presses().T.copy(), dimension_names=("channel", "time"))


@measured(6)
def structure_with_time(folder: Path) -> None:
    """Simulink's structure with time: one clock, signals.values in an array of structures."""
    from scipy.io import savemat

    rows = presses()
    signals = np.zeros(3, dtype=[("values", object), ("label", object)])
    for number, name in enumerate(("depth", "c0", "c1")):
        signals[number] = (rows[:, 1 + number][:, None], name)
    savemat(folder / "run.mat", {"logsout": {"time": rows[:, 0][:, None], "signals": signals}})


@measured(6)
def clock_each(folder: Path) -> None:
    """A clock for each stream inside one table, of other rates, the shorter ones padded with blanks."""
    stage, board = presses(rate=50), presses()
    cells = []
    for number, row in enumerate(texts(stage)):
        pair = texts(board)[number] if number < len(board) else ["", "", "", ""]
        cells.append([pair[2], pair[3], pair[0], row[1], row[0]])
    write(folder, cells, ("c0 [pF]", "c1 [pF]", "time_c [s]", "depth [mm]", "time_z [s]"))


@measured(6, told="position|depth")
def depth_in_long_table(folder: Path) -> None:
    """A long table in which the depth is one more channel: depth is the position."""
    cells = [[row[0], name, row[k]] for row in texts(presses()) for k, name in ((1, "depth"), (2, "c0"), (3, "c1"))]
    write(folder, cells, ("t [s]", "channel", "value"))


@measured(6, told="kind|line|field|not in|position|depth")
def lines_of_two_kinds(folder: Path) -> None:
    """Lines of JSON of two kinds in one log, each with its own time and rate."""
    lines = [{"t": r[0], "topic": "stage", "depth": r[1]} for r in presses(rate=50).tolist()]
    lines += [{"t": r[0] + 0.003, "topic": "board", "c0": r[2], "c1": r[3]} for r in presses().tolist()]
    lines.sort(key=lambda line: line["t"])
    (folder / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


@measured(6, recordings=6)
def split_table(folder: Path) -> None:
    """Folders trial=1, trial=2 with parts of Parquet, as a table that is split on disk."""
    import pyarrow as pa
    from pyarrow import parquet

    for trial in (1, 2):
        rows = presses(seed=trial)
        (folder / f"trial={trial}").mkdir()
        for part, half in enumerate((rows[:150], rows[150:])):
            table = pa.table({n.split()[0]: half[:, k] for k, n in enumerate(NAMES)})
            parquet.write_table(table, folder / f"trial={trial}" / f"part-{part}.parquet")


@measured(6)
def time_in_index(folder: Path) -> None:
    """A frame's index of pandas in Parquet holds the time (timedelta)."""
    import pandas

    rows = presses()
    frame = pandas.DataFrame(
        rows[:, 1:], columns=["depth", "c0", "c1"], index=pandas.to_timedelta(rows[:, 0], unit="s")
    )
    frame.to_parquet(folder / "run.parquet")


@measured(6)
def arrow_stream(folder: Path) -> None:
    """Arrow's stream format under .arrow: read, or refused with the way out."""
    import pyarrow as pa

    table = pa.table({n.split()[0]: presses()[:, k] for k, n in enumerate(NAMES)})
    with pa.ipc.new_stream(folder / "run.arrow", table.schema) as writer:
        writer.write_table(table)


@measured(6, recordings=6, told="zero|rest|apart")
def zero_by_file(folder: Path) -> None:
    """Each file has its own zero of the stage, up to 0.4 mm apart: told."""
    for number, shift in enumerate((0.0, 0.4)):
        rows = presses(seed=number)
        rows[:, 1] += shift
        write(folder, rows, file=f"run_{number}.csv")


@measured(6, recordings=3, told="air|no press|left out|never|not.*press")
def run_in_the_air(folder: Path) -> None:
    """A run in the air for the board's offset beside the trials: no press of it."""
    write(folder, presses(), file="run_1.csv")
    rows = presses(seed=1)
    rows[:, 1], rows[:, 2:] = 0.0, 10 + np.random.default_rng(1).normal(0, 0.002, (len(rows), 2))
    write(folder, rows, file="run_2.csv")


@measured(7, needed="left out|missing|zero bytes|hold no number")
def garbage_inside(folder: Path) -> None:
    """4 kB of another file in the middle of a text: other rows stay, the loss is counted."""
    write(folder, presses())
    data = (folder / "run.csv").read_bytes()
    middle = data.index(b"\n", len(data) // 2) + 1
    noise = np.random.default_rng(3).integers(128, 250, 4096).astype(np.uint8).tobytes()
    (folder / "run.csv").write_bytes(data[:middle] + noise + b"\n" + data[middle:])


@measured(7, needed="line|left out|row")
def cut_line_of_json(folder: Path) -> None:
    """A line of JSON is cut in the middle of the file: one row less, counted."""
    lines = [json.dumps(dict(zip(("t", "depth", "c0", "c1"), r, strict=True))) for r in presses().tolist()]
    lines[120] = lines[120][:40]
    (folder / "run.jsonl").write_text("\n".join(lines) + "\n")


@measured(7, recordings=6, needed="empty|not read|left out|refused|run_2")
def bad_file_among_good(folder: Path) -> None:
    """One of three files is empty and one cut off in a row: six presses stay, the others are named."""
    write(folder, presses(), file="run_1.csv")
    (folder / "run_2.csv").write_text("")
    write(folder, presses(seed=2), file="run_3.csv")
    data = (folder / "run_3.csv").read_text()
    (folder / "run_3.csv").write_text(data[: data.index("\n14.") + 9])


@measured(8, needed="2 channels")
def quantities_beside(folder: Path) -> None:
    """Stress, strain, temperature, humidity, battery and signal strength beside two channels: two channels."""
    rows, rng = presses(), np.random.default_rng(5)
    force = 0.8 * rows[:, 1] + rng.normal(0, 0.001, len(rows))
    others = [force, force / 28.3, rows[:, 1] / 12 * 100, 23 + rng.normal(0, 0.02, len(rows)),
              41 + rng.normal(0, 0.1, len(rows)), np.linspace(3.9, 3.88, len(rows)),
              np.round(-61 + rng.normal(0, 1, len(rows)))]  # fmt: skip
    names = ("Load [N]", "Stress [MPa]", "Strain [%]", "temp_board [°C]", "humidity [%]", "battery [V]", "rssi [dBm]")
    write(folder, np.column_stack([rows, *others]), (*NAMES, *names))


@measured(8, told="channels?")
def motion_beside(folder: Path) -> None:
    """Accelerations and turn rates of the holder beside two channels: no channels, or asked."""
    rows, rng = presses(), np.random.default_rng(6)
    names = ("acc_x [m/s^2]", "acc_y [m/s^2]", "acc_z [m/s^2]", "gyro_x [deg/s]", "gyro_y [deg/s]", "gyro_z [deg/s]")
    motion = rng.normal([0, 0, 9.81, 0, 0, 0], 0.05, (len(rows), 6))
    write(folder, np.column_stack([rows, motion]), (*NAMES, *names))


@measured(8)
def target_beside(folder: Path) -> None:
    """The target of each press beside the measured depth: the measured one."""
    rows = presses()
    target = np.where(rows[:, 1] > 0, 1.5, 0.0)
    write(folder, np.column_stack([rows[:, 0], target, rows[:, 1:]]), ("t [s]", "depth_target [mm]", *NAMES[1:]))


@measured(8, told="not read")
def files_of_editors(folder: Path) -> None:
    """Copies of a run that an editor and a Mac left (~$run.xlsx, ._run.csv, run.csv.bak): three presses."""
    write(folder, presses())
    (folder / "._run.csv").write_bytes(b"\x00\x05\x16\x07" + bytes(78))
    (folder / "~$run.xlsx").write_bytes(b"\x05owner" + bytes(160))
    (folder / "run.csv.bak").write_text((folder / "run.csv").read_text())
    (folder / "Thumbs.db").write_bytes(b"\xd0\xcf\x11\xe0" + bytes(60))


@measured(11, told="LFS")
def pointer_of_lfs(folder: Path) -> None:
    """A pointer of Git LFS in place of the data: refused by that name."""
    (folder / "run.csv").write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{'4d7a2146' * 8}\nsize 12345\n"
    )


@measured(11, told="HTML")
def page_of_login(folder: Path) -> None:
    """A page of a log-in saved as .csv: refused by that name."""
    (folder / "run.csv").write_text(
        "<!DOCTYPE html>\n<html><head><title>Sign in</title></head>\n<body>1, 2, 3</body></html>\n"
    )
