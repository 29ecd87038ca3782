"""An input with its truth: what a lab measured, and how its file presents it.

The truth stands before the data. An import is right if its recordings have these figures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

NAMES = ("t [s]", "depth [mm]", "c0 [pF]", "c1 [pF]")
"""Columns of `presses`."""
FIRST_STAMP = 1_764_416_433
"""Unix time of the first row of inputs with dates [s]."""


@dataclass(frozen=True)
class Truth:
    """Right figures of an input. Its channel c0 is 10 pF and 1 pF per mm of depth."""

    kind: int
    """Number of the kind of fault, 1 to 12 (README)."""
    words: str
    """What is in the file, and what is right."""
    recordings: int = 3
    depth: float = 1.2
    """Depth of each press [mm]."""
    rate: float = 20.0
    """Rate of the channels [Hz]."""
    told: str = ""
    """Pattern of words with which other figures are no silent fault."""
    needed: str = ""
    """Pattern of words without which the right figures are a silent fault: something was left out or replaced."""
    aligned: bool = True
    """Whether c0 must follow the depth row by row."""


@dataclass(frozen=True)
class Input:
    """An input by its maker's name."""

    name: str
    truth: Truth
    make: Callable[[Path], None]
    """Writes the files into an empty folder."""


INPUTS: dict[str, Input] = {}


def measured(kind: int, **figures: object) -> Callable[[Callable[[Path], None]], Callable[[Path], None]]:
    """Register the maker of an input with its truth, whose words are the maker's docstring."""

    def register(make: Callable[[Path], None]) -> Callable[[Path], None]:
        INPUTS[make.__name__] = Input(make.__name__, Truth(kind, make.__doc__ or "", **figures), make)  # type: ignore[arg-type]
        return make

    return register


def presses(count: int = 3, rate: float = 20.0, seed: int = 0) -> np.ndarray:
    """Return times [s], depths [mm] and two channels [pF] of presses of 1.2 mm, shape (rows, 4)."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum([0.0, 1.0, 1.0, 1.0, 1.0, 1.0] * count)
    time = np.arange(0, knots[-1], 1 / rate)
    depth = np.interp(time, knots, [0.0, 0.0, 1.2, 1.2, 0.0, 0.0] * count)
    channels = 10 + depth[:, None] * [1.0, 0.6] + rng.normal(0, 0.002, (len(time), 2))
    return np.column_stack([time, depth, channels])


def texts(rows: np.ndarray, places: int = 5) -> list[list[str]]:
    """Return rows as cells of text."""
    return [[f"{value:.{places}f}" for value in row] for row in rows]


def write(
    folder: Path, rows: list[list[str]] | np.ndarray, names: tuple[str, ...] = NAMES, *, file: str = "run.csv",
    mark: str = ",", head: str = "", tail: str = "", encoding: str = "utf-8",
) -> None:  # fmt: skip
    """Write a text file of columns."""
    cells = texts(rows) if isinstance(rows, np.ndarray) else rows
    lines = [*([mark.join(names)] if names else []), *(mark.join(row) for row in cells)]
    (folder / file).write_text(head + "\n".join(lines) + "\n" + tail, encoding=encoding)
