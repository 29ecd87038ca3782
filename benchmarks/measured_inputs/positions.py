"""Kind 2: positions that jump, rest, wrap or come from another axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from truth import NAMES, measured, presses, texts, write


@measured(2, told="jump|wrap|far|machine|mm/s|codes?")
def wrapped_position(folder: Path) -> None:
    """A 16-bit position [um] passes 0 and shows 65.5 mm while the tip rests above the skin: no press of 65 mm."""
    rows = presses()
    position = np.rint(rows[:, 1] * 1000 - np.where(rows[:, 1] == 0, 3, 0)).astype(int) % 65536
    write(folder, [[c[0], str(p), *c[2:]] for c, p in zip(texts(rows), position, strict=True)],
          ("t [s]", "position [um]", *NAMES[2:]))  # fmt: skip


@measured(2, told="rest|zero|jump|shift|level", recordings=6)
def tared_between(folder: Path) -> None:
    """The stage is tared in the middle, after it went 0.5 mm up: told."""
    rows = presses(6)
    rows[rows[:, 0] >= 15, 1] -= 0.5
    write(folder, rows)


@measured(2, told="sign|never reaches|depth 0|above", recordings=6)
def sign_by_file(folder: Path) -> None:
    """The second file counts compression as negative: told or turned."""
    first, second = presses(), presses(seed=1)
    second[:, 1] *= -1
    write(folder, first, file="run_1.csv")
    write(folder, second, file="run_2.csv")


@measured(2, told="zero|depth 0|highest")
def absolute_height(folder: Path) -> None:
    """An absolute height falls from 120.35 mm; depth is counted from the highest: 1.2 mm, asked."""
    rows = presses()
    rows[:, 1] = 120.35 - rows[:, 1]
    write(folder, rows, ("t [s]", "z [mm]", *NAMES[2:]))


@measured(2, needed="coarse|stair|apart|every|Hz|slow", aligned=False)
def slow_reports(folder: Path) -> None:
    """The stage reports at 1 Hz in its own file, channels at 20 Hz: told."""
    rows = presses()
    write(folder, rows[:, [0, 2, 3]], ("t [s]", *NAMES[2:]), file="board.csv")
    write(folder, rows[::20, :2], NAMES[:2], file="stage.csv")


@measured(2)
def position_on_change(folder: Path) -> None:
    """A position that is sent only when it changes: the rests and holds are between two messages."""
    rows = presses()
    write(folder, rows[:, [0, 2, 3]], ("t [s]", *NAMES[2:]), file="board.csv")
    moving = np.flatnonzero(np.diff(rows[:, 1], prepend=-1.0, append=-1.0)[:-1] != 0)
    kept = sorted({*moving.tolist(), *(moving - 1).tolist()} - {-1})
    write(folder, rows[kept, :2], NAMES[:2], file="stage.csv")


@measured(2, needed="set aside|left out|missing|jump")
def lost_head(folder: Path) -> None:
    """Single reads of 3276.7 (an encoder without its sensor head), one a press: set aside and counted."""
    rows = presses()
    rows[[45, 145, 245], 1] = 3276.7
    write(folder, rows)


@measured(2, needed="dropouts")
def old_values(folder: Path) -> None:
    """Single rows on the ramps show the position of 1 s before: set aside and counted."""
    rows = presses()
    for row in (30, 70, 130, 170, 230, 270):
        rows[row, 1] = rows[row - 20, 1]
    write(folder, rows)


@measured(2, needed="jump|fast|mm/s|rest|zero|shift")
def slipped_encoder(folder: Path) -> None:
    """The encoder slips by 0.3 mm inside the second press: told."""
    rows = presses(6)
    rows[rows[:, 0] >= 8.5, 1] += 0.3
    write(folder, rows)


@measured(2, told="ends|only|without|position|left out|range", recordings=3)
def stage_ends_early(folder: Path) -> None:
    """The log of the stage ends 4 s before that of the channels: no press is made up of its last value."""
    rows = presses()
    write(folder, rows[:, [0, 2, 3]], ("t [s]", *NAMES[2:]), file="board.csv")
    write(folder, rows[: int(12.3 * 20), :2], NAMES[:2], file="stage.csv")


@measured(2, told="unit|0.0012|metre|deep")
def pose_in_metres(folder: Path) -> None:
    """The position in metres without a unit, as a robot's pose has it: 1.2 mm, told or asked."""
    rows = presses()
    rows[:, 1] = 0.35 - rows[:, 1] / 1000
    write(folder, [[f"{v:.6f}" for v in row] for row in rows], ("time", "pose.position.z", "c0", "c1"))


@measured(2, told="set point|set_point|command|error")
def set_point_and_error(folder: Path) -> None:
    """Set point and following error, no position: their difference, or told."""
    rows = presses()
    error = 0.15 * np.sign(np.gradient(rows[:, 1]))
    write(folder, np.column_stack([rows[:, 0], rows[:, 1] + error, error, rows[:, 2:]]),
          ("t [s]", "set_point [mm]", "following_error [mm]", *NAMES[2:]))  # fmt: skip


@measured(2, told="zero|jump|set aside|left out", needed="")
def zeros_first(folder: Path) -> None:
    """A first row of zeros before the absolute heights: no recording of its own, no depth of 120 mm."""
    rows = presses()
    rows[:, 1] = 120.35 - rows[:, 1]
    rows[0, 1:] = 0
    write(folder, rows, ("t [s]", "z [mm]", *NAMES[2:]))
