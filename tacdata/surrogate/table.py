"""Assembles solved presses into the table of a `TableResponse`: mirrored, continued beyond its ends, written."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.chain.table_response import TableResponse
from tacdata.errors import SolveError
from tacdata.replacement import replacement
from tacdata.sensor import Sensor
from tacdata.surrogate.grid import EDGE, Grid
from tacdata.surrogate.reading import ReadingCurve
from tacdata.surrogate.solved import Solved
from tacdata.surrogate.symmetry import mirrored
from tacdata.transduction import Transducer

_STEEPEST = 3.0
"""Largest exponent of force over depth for continuing a press to deeper states [1]."""


@dataclass(frozen=True)
class LoadTable:
    """Loads by position and depth, and their curve to readings."""

    grid: Grid
    tools: tuple[str, ...]
    """Name of each tool."""
    load: np.ndarray
    """Of every taxel [N, mm or pF, by `ReadingCurve.by`], shape (tools, a, b, d, channels)."""
    normal: np.ndarray
    """Normal force on the indenter [N], shape (tools, a, b, d)."""
    solved: np.ndarray
    """Whether a node is a solved press (or its mirror image), shape (tools, a, b, d), bool."""
    reading: ReadingCurve
    error: float = 0.0
    """Root mean square error of the loads, over that of the loads [1]; 0 if unknown."""

    @property
    def response(self) -> TableResponse:
        """The response of the table."""
        return TableResponse(**self._arrays, tools=self.tools, error=self.error)

    @property
    def _arrays(self) -> dict[str, np.ndarray]:
        g, r = self.grid, self.reading
        curve = {name: getattr(r, name) for name in ("curve_load", "curve_signal", "gain", "offset")}
        return {"x": g.x, "y": g.y, "depth": g.depth, "load": self.load, "force": self.normal, **curve}

    def write(self, path: Path, provenance: dict[str, Any]) -> None:
        """Write the table (.npz), with ``provenance`` as JSON text."""
        # Single precision is far finer than the loads' error, and halves the file.
        loads = {"load": self.load.astype(np.float32), "force": self.normal.astype(np.float32)}
        values: dict[str, Any] = {**self._arrays, **loads, "tools": self.tools, "solved": self.solved}
        stamp = np.array(json.dumps(provenance))
        with replacement(path) as stream:
            np.savez_compressed(stream, **values, error=self.error, provenance=stamp)

    def uncovered(self, places: Sequence[tuple[str, np.ndarray, float]]) -> list[tuple[str, np.ndarray, float]]:
        """Return the presses (tool, x and y [mm], depth [mm]) that are not covered by solved nodes."""
        return [p for p in places if not self.covers(self.tools.index(p[0]), p[1], p[2])]

    def covers(self, tool: int, place: np.ndarray, deepest: float) -> bool:
        """Return whether a press is covered by solved nodes.

        Args:
            tool: Number of the tool.
            place: x and y [mm], shape (2,).
            deepest: Depth [mm].
        """
        at = [np.searchsorted(axis, v - 1e-9) for axis, v in zip((self.grid.x, self.grid.y), place, strict=True)]
        if not all(0 < k < len(axis) for k, axis in zip(at, (self.grid.x, self.grid.y), strict=True)):
            return False
        # One level suffices: a press is solved from depth 0 on, so that all above it are solved as well.
        level = int(np.searchsorted(self.grid.depth, deepest - 1e-9))
        if level >= len(self.grid.depth):
            return False
        near = self.solved[tool, at[0] - 1 : at[0] + 1, at[1] - 1 : at[1] + 1, level]
        return bool(near.all())


def assembled(
    grid: Grid,
    presses: Sequence[dict[tuple[int, int], Solved]],
    tools: tuple[str, ...],
    reading: ReadingCurve,
    sensor: Sensor,
) -> LoadTable:
    """Return the table from the presses of each tool, by node.

    Args:
        grid: The nodes.
        presses: For each tool, node -> press; nodes that cannot be pressed are missing.
        tools: Name of each tool.
        reading: The curve from loads to readings.
        sensor: The sensor.

    Raises:
        SolveError: If a tool could be pressed nowhere.
    """
    shape = (len(tools), len(grid.x), len(grid.y), len(grid.depth))
    load = np.zeros((*shape, sensor.taxels.count))
    normal, solved = np.zeros(shape), np.zeros(shape, dtype=bool)
    transducer = Transducer.of(sensor)
    for t, solutions in enumerate(presses):
        if not solutions:
            raise SolveError(
                f"{tools[t]} can be pressed at none of the places",
                "places where it stays inside a bonded rim",
                "press elsewhere, or describe another bonding in the sensor file",
            )
        _place(grid, solutions, reading, transducer, sensor, load[t], normal[t], solved[t])
        _continue(grid, load[t], normal[t], solved[t])
    return LoadTable(grid, tools, load, normal, solved, reading)


def _place(
    grid: Grid,
    solutions: dict[tuple[int, int], Solved],
    reading: ReadingCurve,
    transducer: Transducer,
    sensor: Sensor,
    load: np.ndarray,
    normal: np.ndarray,
    solved: np.ndarray,
) -> None:
    times = np.zeros(normal.shape)
    for (i, j), press in solutions.items():
        values, count = reading.load(press.loads, transducer), len(press.normal)
        sides = [(a, b) for a in (False, True) for b in (False, True)] if grid.folded else [(False, False)]
        for over_x, over_y in sides:
            # Presses on an axis of symmetry meet their own mirror images: `times` makes them a mean.
            at = (len(grid.x) - 1 - i if over_x else i, len(grid.y) - 1 - j if over_y else j)
            load[*at, :count] += mirrored(values, sensor, over_x, over_y)
            normal[*at, :count] += press.normal
            times[*at, :count] += 1
    solved[:] = times > 0
    load /= np.maximum(times, 1)[..., None]
    normal /= np.maximum(times, 1)


def _continue(grid: Grid, load: np.ndarray, normal: np.ndarray, solved: np.ndarray) -> None:
    """Fill the nodes that were not solved: deeper by cubics, then by a power law; elsewhere from the nearest position;
    ends by parabolas.
    """
    pressed = np.asarray(np.any(solved, axis=2))
    nodes = np.argwhere(pressed)
    levels = np.sum(solved, axis=2)
    for k in range(len(nodes)):
        i, j = nodes[k].tolist()
        _deepen(grid.depth, load[i, j], normal[i, j], int(levels[i, j]))
    # The order matters: copied columns are complete by now, and the ends continue what is filled here.
    for i in range(EDGE, len(grid.x) - EDGE):
        for j in range(EDGE, len(grid.y) - EDGE):
            if not pressed[i, j]:
                a, b = nodes[int(np.argmin(np.sum(np.square(nodes - (i, j)), axis=1)))].tolist()
                load[i, j], normal[i, j] = load[a, b], normal[a, b]
    for values in (load, normal):
        for axis in (0, 1):
            front = np.moveaxis(values, axis, 0)
            for k in range(EDGE - 1, -1, -1):
                front[k] = 3 * front[k + 1] - 3 * front[k + 2] + front[k + 3]
                front[-1 - k] = 3 * front[-2 - k] - 3 * front[-3 - k] + front[-4 - k]


def _deepen(depth: np.ndarray, load: np.ndarray, normal: np.ndarray, count: int) -> None:
    # The cubic through the last four nodes bends no spline through them. A power law does: by 7 % at the deepest press.
    for _ in range(min(EDGE, len(depth) - count) if count >= 4 else 0):
        for values in (load, normal):
            values[count] = 4 * values[count - 1] - 6 * values[count - 2] + 4 * values[count - 3] - values[count - 4]
        count += 1
    # The state at depth 0 has no logarithm.
    last, previous = count - 1, max(count - 2, 1)
    power = 1.5
    if last > previous and normal[last] > normal[previous] > 0:
        power = float(np.log(normal[last] / normal[previous]) / np.log(depth[last] / depth[previous]))
    for k in range(count, len(depth)):
        factor = (depth[k] / depth[last]) ** min(power, _STEEPEST)
        load[k], normal[k] = load[last] * factor, normal[last] * factor
