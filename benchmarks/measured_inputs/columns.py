"""Kinds 4 to 8: columns that are easily taken for others, as instruments and laboratories write them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from truth import NAMES, measured, presses, texts, write


def _force(rows: np.ndarray) -> np.ndarray:
    """Return a force that follows the depth [N], shape (rows,)."""
    return 2 * rows[:, 1] + np.random.default_rng(5).normal(0, 0.004, len(rows))


@measured(8)
def counter_of_gauge(folder: Path) -> None:
    """A gauge's count of readings in steps of 10, and Fz in lbF: the count is no channel."""
    rows = presses()
    count = 1000.0 + 10 * np.arange(len(rows))
    cells = np.column_stack([count, rows, _force(rows) / 4.448222])
    write(folder, [[f"{row[0]:.0f}", *texts(row[None, 1:])[0]] for row in cells], ("Reading", *NAMES, "Load [lbF]"))


@measured(4)
def counts_per_millimetre_and_newton(folder: Path) -> None:
    """Whole numbers of an encoder and a converter; their sizes stand in one comment."""
    rows = presses()
    cells = [
        [f"{t:.2f}", f"{d * 400:.0f}", f"{f * 1e4:.0f}", f"{a:.5f}", f"{b:.5f}"]
        for (t, d, a, b), f in zip(rows, _force(rows), strict=True)
    ]
    head = "# 10000 counts per N, 400 counts per mm\n"
    write(folder, cells, ("t [s]", "enc_count", "Fz", "c0 [pF]", "c1 [pF]"), head=head)


@measured(4, needed="unit: N")
def wrist_of_robot(folder: Path) -> None:
    """A wrist's force and torque in an array called wrist_ft: no feet, and its unit is asked."""
    rows = presses()
    wrench = np.column_stack([0 * rows[:, :2], _force(rows), 0 * rows[:, :3]])
    np.savez(folder / "run.npz", t=rows[:, 0], depth_mm=rows[:, 1], wrist_ft=wrench, skin=rows[:, 2:])


@measured(6, told="each name comes again")
def specimens_side_by_side(folder: Path) -> None:
    """Two specimens side by side, each with its clock, below their names: the second is not read as channels."""
    first, second = presses(), presses(seed=1)
    head = ",".join(name for title in ("1 _ 1", "1 _ 2") for name in (title, "", "", "")) + "\n"
    names = ("Time", "Disp.", "c0", "c1") * 2
    cells = [["sec", "mm", "pF", "pF"] * 2, *texts(np.column_stack([first, second]))]
    write(folder, cells, names, head=head)


@measured(5, told="names in the header")
def name_too_few(folder: Path) -> None:
    """A temperature among the values that the header does not name: no value is taken for its neighbour."""
    rows = presses()
    write(folder, np.column_stack([rows[:, 0], 22 + 0.01 * rows[:, 0], rows[:, 1:]]))


@measured(5, told="names in the header")
def name_too_many(folder: Path) -> None:
    """A name among the header whose column was not written."""
    write(folder, presses(), (NAMES[0], "temp [C]", *NAMES[1:]))


@measured(2, told="other side of zero")
def sign_changes(folder: Path) -> None:
    """A stage that counts the other way from the middle on: asked, with the row."""
    rows = presses(count=4)
    rows[len(rows) // 2 :, 1] *= -1
    write(folder, rows)


@measured(8, told="holds text")
def readings_in_text(folder: Path) -> None:
    """Readings as hexadecimal words in one text, next to constants and counters: asked, no constant is a channel."""
    rows = presses()
    lines = [
        {
            "message": k,
            "sensors": 1,
            "t_s": t,
            "depth_mm": d,
            "fz_N": f,
            "data": f"{round(1000 * a):X},{round(1000 * b):X}",
        }
        for k, ((t, d, a, b), f) in enumerate(zip(rows.tolist(), _force(rows).tolist(), strict=True))
    ]
    (folder / "run.jsonl").write_text("\n".join(map(json.dumps, lines)))


@measured(8)
def specimen_of_one_file(folder: Path) -> None:
    """One file called Probe 1: its path has no {part}."""
    write(folder, presses(), file="Probe 1.csv")


@measured(5)
def lines_with_units(folder: Path) -> None:
    """Lines of a terminal: a time in brackets, then names, values and units."""
    lines = [f"[{t:.2f} s] depth={d:.4f} mm, c0={a:.4f} pF, c1={b:.4f} pF" for t, d, a, b in presses()]
    (folder / "run.log").write_text("log of a terminal\n" + "\n".join(lines) + "\n")


@measured(6)
def trials_of_json(folder: Path) -> None:
    """An object for each trial, with lists; rate and units in a block."""
    rows = presses().reshape(3, -1, 4)
    trials = {f"trial_{k}": {"depth": r[:, 1].tolist(), "skin": r[:, 2:].tolist()} for k, r in enumerate(rows)}
    settings = {"sampling_rate_hz": 20, "units": {"depth": "mm", "skin": "pF"}}
    (folder / "all.json").write_text(json.dumps({"metadata": settings, "data": trials}))


@measured(5)
def levels_of_parquet(folder: Path) -> None:
    """Names of two levels, with the unit below, as pandas writes them."""
    import pyarrow as pa
    from pyarrow import parquet

    names = [str(tuple(name.rstrip("]").split(" ["))) for name in NAMES]
    parquet.write_table(pa.table(dict(zip(names, presses().T, strict=True))), folder / "run.parquet")


@measured(4)
def words_of_labview(folder: Path) -> None:
    """Units as words above the names, and no values of X: its step is in the head."""
    rows = presses()
    rows[:, 1] /= 25.4
    head = "Y_Unit_Label\tInches\tPicofarads\tPicofarads\t\nDelta_X\t0.05\t0.05\t0.05\t\n***End_of_Header***\n"
    cells = [["", *row[1:]] for row in texts(rows, 7)]
    write(folder, cells, ("X_Value", "Position", "c0", "c1", "Comment"), file="run.lvm", mark="\t", head=head)


@measured(8)
def phases_with_holds(folder: Path) -> None:
    """Parts of a cycle as words behind its number: a trial is the whole cycle."""
    rows = presses()
    slope = np.gradient(rows[:, 1])
    parts = np.where(slope > 0.01, "load", np.where(slope < -0.01, "unload", "hold"))
    cells = [
        [f"C{int(row[0] // 5) + 1}_{part}", *cell] for row, part, cell in zip(rows, parts, texts(rows), strict=True)
    ]
    write(folder, cells, ("cycle", *NAMES))


@measured(3, needed="taken for no value")
def overload_in_words(folder: Path) -> None:
    """A channel that is written as a word where it is too large, in a tenth of the rows: asked, and missing."""
    cells = [[*row[:3], "+OVER" if float(row[3]) > 10.7 else row[3]] for row in texts(presses())]
    write(folder, cells)


@measured(8)
def letters_in_volts(folder: Path) -> None:
    """Channels a to d in V next to a depth called z: d is no depth."""
    rows = presses()
    write(folder, np.column_stack([rows, rows[:, 2:]]), ("t [s]", "z [mm]", "a [V]", "b [V]", "c [V]", "d [V]"))


@measured(1)
def cycle_in_the_head(folder: Path) -> None:
    """A gauge's numbers of rows, and its sampling cycle in the head."""
    cells = [[str(k), *row[1:]] for k, row in enumerate(texts(presses()))]
    write(folder, cells, ("No.", *NAMES[1:]), head="Model,LK\nSampling Cycle(s),0.05\n\n")


@measured(6, told="each name comes again")
def runs_by_number(folder: Path) -> None:
    """Two runs side by side; their number stands behind name and unit, and an empty column between them."""
    first, second = presses(), presses(seed=1)
    names = [f"{name} Run #{k}" for k in (1, 2) for name in ("Time (s)", "Position (mm)", "c0 (pF)", "c1 (pF)")]
    cells = [[*a, "", *b] for a, b in zip(texts(first), texts(second), strict=True)]
    write(folder, cells, (*names[:4], "", *names[4:]))


@measured(1, needed="wraps")
def packets_lost(folder: Path) -> None:
    """Numbers of packets that wrap at 256, ten of them lost; the rate stands in a comment."""
    rows = np.delete(presses(), np.arange(105, 115), axis=0)
    count = np.delete(np.arange(300), np.arange(105, 115)) % 256
    cells = [[str(k), *row[1:]] for k, row in zip(count, texts(rows), strict=True)]
    write(folder, cells, ("pkt", *NAMES[1:]), head="# sample rate 20 Hz\n")


@measured(8)
def arrays_by_number(folder: Path) -> None:
    """A wrench and a place as numbered columns: no channels."""
    rows = presses()
    names = ["t [s]", *(f"FT_{k}" for k in range(6)), *(f"pos_{k}" for k in range(3)), "c0 [pF]", "c1 [pF]"]
    still = np.zeros((len(rows), 2))
    wrench = np.column_stack([still, _force(rows), still, still[:, :1]])
    write(folder, np.column_stack([rows[:, 0], wrench, still, 80 - rows[:, 1], rows[:, 2:]]), tuple(names))


@measured(6)
def names_in_an_array(folder: Path) -> None:
    """A matrix, and the names of its columns in an array of texts."""
    np.savez(folder / "run.npz", data=presses(), labels=np.array(NAMES))
