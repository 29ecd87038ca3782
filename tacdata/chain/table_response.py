"""A response from solved presses on a grid: cubic splines over place and the root of depth."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import spline_filter1d

from tacdata.chain.response import Response
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath

FIELDS = ("x", "y", "depth", "load", "force", "curve_load", "curve_signal", "gain", "offset", "tools")

BEYOND = 1e4
"""So far the curve from load to reading goes on straight beyond its ends [its range]."""
KEPT = 12
"""Evaluations remembered: most candidates leave the pose alone."""


class TableResponse(Response):
    """Loads solved on x, y, depth for each tool, and the curve from load to reading."""

    def __init__(
        self,
        x: np.ndarray,
        y: np.ndarray,
        depth: np.ndarray,
        load: np.ndarray,
        force: np.ndarray,
        curve_load: np.ndarray,
        curve_signal: np.ndarray,
        gain: np.ndarray,
        offset: np.ndarray,
        tools: tuple[str, ...],
        error: float = 0.0,
    ) -> None:
        """Keep the table.

        Args:
            x: Places solved [mm], shape (a,), equally spaced.
            y: Places solved [mm], shape (b,), equally spaced.
            depth: Depths solved [mm], shape (d,), from 0, equally spaced in their root.
            load: Loads, shape (tools, a, b, d, channels).
            force: Normal force [N], shape (tools, a, b, d).
            curve_load: Loads at which the curve is given, shape (m,), increasing.
            curve_signal: Reading above idle over gain at those loads, shape (m,).
            gain: Gain of each channel, shape (channels,).
            offset: Reading without load, shape (channels,).
            tools: Name of each tool.
            error: Root mean square error of the loads, over that of the loads [1]; 0 if none is stated.
        """
        self.error = error
        self.x, self.y, self.depth, self.tools = x, y, depth, tools
        self._curve = _straight_beyond(curve_load, curve_signal)
        self.gain, self.offset = gain, offset
        self._rough = False
        values = np.concatenate([load, force[..., None]], axis=-1)
        self._splines = [_Table.of(_coefficients(each)) for each in values]
        self._nodes = [_Table.of(_continued(each)) for each in values]
        self._channels = load.shape[-1]
        self._kept: dict[int, _Answer] = {}
        self._forces: dict[int, np.ndarray] = {}

    @property
    def spacing(self) -> float:
        """Largest distance between successive depths [mm]."""
        return float(np.diff(self.depth).max())

    def rougher(self) -> TableResponse:
        """Return the same table read by polynomials through four nodes: off the splines by about the splines' error."""
        coarser = self._copied()
        coarser._rough = True
        return coarser

    @classmethod
    def read(cls, path: StrPath) -> TableResponse:
        """Read a table.

        Raises:
            UsageError: If there is no such file.
            FormatError: If it is no such table.
        """
        path = Path(path)
        if not path.is_file():
            raise UsageError(f"no file {path}", "a response table (.npz)", "check response/file in the model spec")
        try:
            with np.load(path, allow_pickle=False) as data:
                values = {name: data[name] for name in FIELDS}
                load_error = float(data["error"]) if "error" in data else 0.0
        except (ValueError, KeyError, OSError, TypeError) as error:
            raise FormatError(
                f"{path} is no response table ({error})", f"an .npz file with {', '.join(FIELDS)}", "make it again"
            ) from None
        if not 0.0 <= load_error < 1.0:
            raise FormatError(
                f"{path}: an error of the loads of {load_error:g}",
                "a share of the loads, from 0 to 1",
                "make the table again",
            )
        tools = tuple(str(name) for name in values.pop("tools"))
        return cls(**values, tools=tools, error=load_error)

    def idling_at(self, offset: np.ndarray) -> TableResponse:
        """Return the same response with other readings without load, shape (channels,)."""
        copied = self._copied()
        copied.offset = offset
        return copied

    def with_tools(self, order: list[int]) -> TableResponse:
        """Return the same response with its tools in another order, or fewer."""
        copied = self._copied()
        copied._splines, copied._nodes = [self._splines[k] for k in order], [self._nodes[k] for k in order]
        copied.tools = tuple(self.tools[k] for k in order)
        return copied

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the load on each channel, shape (n, channels)."""
        return self._both(pose, tool).load

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the normal force [N], shape (n,)."""
        key = _key(pose, tool)
        if key in self._kept:
            return self._kept[key].force
        # A compliant frame asks for the force alone, at many poses: its own table is one lane wide.
        if key not in self._forces:
            normal = np.zeros(len(pose))
            for rows, values in self._read(pose, tool, force=True):
                normal[rows] = values[:, 0]
            _make_room(self._forces)
            self._forces[key] = _locked(normal)
        return self._forces[key]

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return readings, shape (n, channels); the curve is continued straight beyond its ends."""
        # By identity, which is enough: nobody can write into a load that this table returned (`_locked`).
        cached = next((answer for answer in self._kept.values() if answer.load is load), None)
        if cached is not None and cached.signal is not None:
            return cached.signal
        result = np.interp(load, *self._curve)
        result *= self.gain
        result += self.offset
        if cached is not None:
            cached.signal = _locked(result)
        return result

    def _copied(self) -> TableResponse:
        """Return a response on the same table that remembers nothing."""
        copied = copy.copy(self)
        copied._kept, copied._forces = {}, {}
        return copied

    def _both(self, pose: np.ndarray, tool: np.ndarray) -> _Answer:
        key = _key(pose, tool)
        if key not in self._kept:
            load, normal = np.zeros((len(pose), self._channels)), np.zeros(len(pose))
            for rows, values in self._read(pose, tool):
                load[rows], normal[rows] = values[:, : self._channels], values[:, self._channels]
            _make_room(self._kept)
            self._kept[key] = _Answer(_locked(load), _locked(normal))
        return self._kept[key]

    def _read(self, pose: np.ndarray, tool: np.ndarray, force: bool = False) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Give rows in contact with loads and then the force, or the force alone, shape (m, channels + 1) or (m, 1)."""
        from tacdata.chain.table_kernels import cubic

        # Rows in the air have no load: they are not looked up.
        touching = pose[:, 2] > 0
        for t, table in enumerate(self._nodes if self._rough else self._splines):
            rows = np.flatnonzero(touching & (tool == t))
            values = table.force if force else table.both
            yield rows, cubic(values, self._places(pose[rows]), self._rough, 1 if force else self._channels + 1)

    def _places(self, pose: np.ndarray) -> np.ndarray:
        """Return places in units of nodes, kept inside the table, shape (n, 3)."""
        # Nodes are evenly spaced in the root of depth, where loads at first contact are smooth.
        root = np.sqrt(np.maximum(pose[:, 2], 0.0)) / np.sqrt(self.depth[-1]) * (len(self.depth) - 1)
        column = (pose[:, 0] - self.x[0]) / (self.x[1] - self.x[0])
        row = (pose[:, 1] - self.y[0]) / (self.y[1] - self.y[0])
        last = np.array([len(self.x), len(self.y), len(self.depth)]) - 1.0
        return np.clip(np.stack([column, row, root], axis=-1), 0.0, last)


@dataclass
class _Answer:
    """The table's loads and readings at one course of poses."""

    load: np.ndarray
    force: np.ndarray
    signal: np.ndarray | None = None
    """Readings, once they were asked for."""


@dataclass(frozen=True)
class _Table:
    """One tool's coefficients or nodes, with continuations beyond the ends: the four nodes of a place always exist."""

    both: np.ndarray
    """Loads, then the force, padded (`tacdata.chain.lanes`), shape (a, b, d, lanes)."""
    force: np.ndarray
    """The force alone, padded, shape (a, b, d, lanes)."""

    @classmethod
    def of(cls, values: np.ndarray) -> _Table:
        """Return the table of loads and force, shape (a, b, 1 + d + 2, channels + 1): depth has its ends already."""
        from tacdata.chain.lanes import padded

        around = np.pad(values, ((1, 2), (1, 2), (0, 0), (0, 0)), mode="reflect")
        return cls(padded(around), padded(around[..., -1:]))


def _coefficients(values: np.ndarray) -> np.ndarray:
    """Return the coefficients of cubic B-splines through values, shape (a, b, d, k): shape (a, b, 1 + d + 2, k).

    Places are mirrored at their ends. Depth is even about contact, and not-a-knot at its deep end: a mirror there would
    bend loads that still grow flat over the last nodes.
    """
    filtered = spline_filter1d(spline_filter1d(values, order=3, axis=0), order=3, axis=1)
    count = values.shape[2]
    matrix = np.zeros((count + 2, count + 2))
    for k in range(count):
        matrix[k, k : k + 3] = 1 / 6, 4 / 6, 1 / 6
    # Even about depth 0: the coefficients around it are equal. Not-a-knot: the fourth difference vanishes.
    matrix[count, [0, 2]] = 1.0, -1.0
    matrix[count + 1, -5:] = 1.0, -4.0, 6.0, -4.0, 1.0
    inverse = np.linalg.inv(matrix)[:, :count]
    inner = np.einsum("kd,abdc->abkc", inverse, filtered, optimize=True)
    # The last coefficient has weight 0 at the deepest place; it is there so that four nodes always exist.
    return np.concatenate([inner, inner[:, :, -1:]], axis=2)


def _continued(values: np.ndarray) -> np.ndarray:
    """Return nodes with those beyond the ends of depth, shape (a, b, 1 + d + 2, k): even, and on the last cubic."""
    beyond = []
    last = values[:, :, -4:]
    for _ in range(2):
        # The next value of the cubic through the last four.
        following = -last[:, :, :1] + 4 * last[:, :, 1:2] - 6 * last[:, :, 2:3] + 4 * last[:, :, 3:4]
        beyond.append(following)
        last = np.concatenate([last[:, :, 1:], following], axis=2)
    return np.concatenate([values[:, :, 1:2], values, *beyond], axis=2)


def _straight_beyond(at: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve with a point far beyond each end, on the straight line through the last two."""
    far = BEYOND * (at[-1] - at[0])
    low, high = (value[1] - value[0]) / (at[1] - at[0]), (value[-1] - value[-2]) / (at[-1] - at[-2])
    return (
        np.concatenate([[at[0] - far], at, [at[-1] + far]]),
        np.concatenate([[value[0] - low * far], value, [value[-1] + high * far]]),
    )


def _key(pose: np.ndarray, tool: np.ndarray) -> int:
    # By content: candidates make equal poses anew, so that their identities differ.
    return hash((pose.tobytes(), tool.tobytes()))


def _make_room(cache: dict[int, Any]) -> None:
    """Forget the oldest answer where as many are kept as may be."""
    if len(cache) >= KEPT:
        cache.pop(next(iter(cache)))


def _locked(values: np.ndarray) -> np.ndarray:
    """Return values that nobody may write into: others are given the same."""
    values.flags.writeable = False
    return values
