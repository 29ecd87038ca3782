"""Kind 1: times that go back, wrap, are set or are written in an odd way."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from truth import FIRST_STAMP, NAMES, measured, presses, texts, write


@measured(1, told="time goes back")
def half_wrap(folder: Path) -> None:
    """Half-wrap of a logger: in the middle times fall by 2^31 us; 20 Hz, cut or continued."""
    rows = presses()
    rows[:, 0] += 5440
    rows[150:, 0] -= 2147.483648
    write(folder, rows)


@measured(1, told="time goes back", recordings=0)
def step_of_ptp(folder: Path) -> None:
    """PTP sets the clock back by 0.4 s in a hold; cut, told or refused."""
    rows = presses()
    rows[np.flatnonzero(rows[:, 0] >= 8.5), 0] -= 0.4
    write(folder, rows)


@measured(1, needed="gap|without rows|jump|pause")
def step_of_ntp(folder: Path) -> None:
    """NTP sets the clock forward by 0.7 s in a hold: told as a gap."""
    rows = presses()
    rows[np.flatnonzero(rows[:, 0] >= 8.5), 0] += 0.7
    write(folder, rows)


@measured(1, told="time goes back|time")
def unpadded_microseconds(folder: Path) -> None:
    """Microseconds without leading zeros (1.50000 for 1.050000): told or refused."""
    rows = presses()
    time = np.rint(rows[:, 0] * 1e6).astype(int) + 1_234
    write(folder, [[f"{t // 10**6}.{t % 10**6}", *cells[1:]] for t, cells in zip(time, texts(rows), strict=True)])


@measured(1, told="time goes back")
def noon_without_half(folder: Path) -> None:
    """A clock of twelve hours without am or pm passes 12:59:59: continued, or cut and told."""
    begin = datetime(2026, 11, 29, 12, 59, 52)
    clock = [(begin + timedelta(seconds=float(t))).strftime("%I:%M:%S.%f")[:-3] for t in presses()[:, 0]]
    write(folder, [[t, *cells[1:]] for t, cells in zip(clock, texts(presses()), strict=True)], ("time", *NAMES[1:]))


@measured(1, told="unit|tick")
def ticks_of_net(folder: Path) -> None:
    """Ticks of .NET, 100 ns since the year 1: 20 Hz, or refused with words on the unit."""
    ticks = [f"{(FIRST_STAMP + 62_135_596_800) * 10**7 + round(t * 1e7)}" for t in presses()[:, 0]]
    write(folder, [[t, *cells[1:]] for t, cells in zip(ticks, texts(presses()), strict=True)], ("Ticks", *NAMES[1:]))


@measured(1, told="time|gap")
def clock_of_nmea(folder: Path) -> None:
    """Time of a GPS message as a number, hhmmss.ss, passes 115959.95: 20 Hz, told or refused."""
    begin = datetime(2026, 11, 29, 11, 59, 52)
    clock = [(begin + timedelta(seconds=float(t))).strftime("%H%M%S.%f")[:-4] for t in presses()[:, 0]]
    write(folder, [[t, *cells[1:]] for t, cells in zip(clock, texts(presses()), strict=True)], ("utc", *NAMES[1:]))


@measured(1, told="rate|time")
def increment_of_scope(folder: Path) -> None:
    """An oscilloscope: numbers of rows, the increment in its first row alone: 20 Hz."""
    rows = presses()
    cells = [[str(k), *line[1:], *(["0.000000e+00", "5.000000e-02"] if not k else ["", ""])]
             for k, line in enumerate(texts(rows))]  # fmt: skip
    cells.insert(0, ["Sequence", "mm", "pF", "pF", "", ""])
    write(folder, cells, ("X", "depth", "CH1", "CH2", "Start", "Increment"))


@measured(1, needed="again|twice|repeat|copies|same")
def rows_sent_again(folder: Path) -> None:
    """The last 2 s before a lost link are sent again: 40 rows counted, 20 Hz."""
    cells = texts(presses())
    write(folder, cells[:150] + cells[110:])


@measured(1, needed="time goes back|header")
def appended_log(folder: Path) -> None:
    """A log that is appended to: header and times begin again; cut."""
    rows = presses()
    cells = texts(rows[:200])
    rows[200:, 0] -= rows[200, 0]
    write(folder, [*cells, list(NAMES), *texts(rows[200:])])


@measured(1)
def two_times(folder: Path) -> None:
    """Time of each cycle and total time stand side by side (testing machine): the total time."""
    rows = presses()
    names = ("Cycle Elapsed Time (s)", "Total Time (s)", "Total Cycles", "Displacement (mm)", "c0 (pF)", "c1 (pF)")
    cycle = np.floor(rows[:, 0] / 5)
    write(folder, np.column_stack([rows[:, 0] % 5, rows[:, 0], cycle, rows[:, 1:]]), names)


@measured(1, told="time goes back|alternate|copies|each time", recordings=0)
def two_boards(folder: Path) -> None:
    """Two boards write into one table; the second one's clock is 300 s behind: split, told or refused."""
    rows = presses()
    cells = [row for pair in zip(texts(np.add(rows, [300, 0, 0, 0])), texts(rows), strict=True) for row in pair]
    write(folder, [[*row, "AB"[k % 2]] for k, row in enumerate(cells)], (*NAMES, "board"))


@measured(1, recordings=9, needed="machine|time goes back")
def three_machines(folder: Path) -> None:
    """Rows of three machines' cycles follow by machine, each from zero: nine presses, cut."""
    cells = [[str(k), *row] for k in range(3) for row in texts(presses(seed=k))]
    write(folder, cells, ("machine", *NAMES))


@measured(1, told="clock|overlap|common|no row|time")
def tai_beside_utc(folder: Path) -> None:
    """A leap: times in UTC for the stage, in TAI (37 s later) for the board, in two files: told or refused."""
    rows = presses(6)
    unix = rows[:, 0] + FIRST_STAMP
    write(folder, [[f"{t + 37:.3f}", *c[2:]] for t, c in zip(unix, texts(rows), strict=True)],
          ("timestamp", "c0 [pF]", "c1 [pF]"), file="board.csv")  # fmt: skip
    write(folder, [[f"{t:.3f}", c[1]] for t, c in zip(unix, texts(rows), strict=True)],
          ("timestamp", "depth [mm]"), file="stage.csv")  # fmt: skip


@measured(1, recordings=6)
def zones_by_file(folder: Path) -> None:
    """Local times with a zone for one file, UTC with Z for the other: one clock."""
    rows = presses(6)
    moments = [datetime.fromtimestamp(FIRST_STAMP, UTC) + timedelta(seconds=float(t)) for t in rows[:, 0]]
    local = [
        f"{(m + timedelta(hours=1)).replace(tzinfo=None).isoformat(timespec='milliseconds')}+01:00" for m in moments
    ]
    plain = [f"{m.replace(tzinfo=None).isoformat(timespec='milliseconds')}Z" for m in moments]
    write(folder, [[t, *c[2:]] for t, c in zip(local, texts(rows), strict=True)],
          ("time", "c0 [pF]", "c1 [pF]"), file="board.csv")  # fmt: skip
    write(folder, [[t, c[1]] for t, c in zip(plain, texts(rows), strict=True)],
          ("time", "depth [mm]"), file="stage.csv")  # fmt: skip


@measured(1, told="clock|zone|overlap|common|zero", recordings=6)
def local_beside_unix(folder: Path) -> None:
    """Local times without a zone for one file, Unix seconds for the other, one hour apart: told or refused."""
    rows = presses(6)
    moments = [datetime.fromtimestamp(FIRST_STAMP + 3600, UTC) + timedelta(seconds=float(t)) for t in rows[:, 0]]
    local = [m.replace(tzinfo=None).isoformat(sep=" ", timespec="milliseconds") for m in moments]
    write(folder, [[t, *c[2:]] for t, c in zip(local, texts(rows), strict=True)],
          ("time", "c0 [pF]", "c1 [pF]"), file="board.csv")  # fmt: skip
    write(folder, [[f"{FIRST_STAMP + t:.3f}", c[1]] for t, c in zip(rows[:, 0], texts(rows), strict=True)],
          ("time", "depth [mm]"), file="stage.csv")  # fmt: skip
