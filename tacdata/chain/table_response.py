"""A response from solved presses on a grid: cubic splines over place and the root of depth."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import spline_filter
from scipy.sparse import csr_matrix

from tacdata.chain.response import Response
from tacdata.errors import FormatError, UsageError

FIELDS = ("x", "y", "depth", "load", "force", "curve_load", "curve_signal", "gain", "offset", "tools")

KEPT = 12
"""Evaluations remembered: most candidates leave the pose alone."""


class TableResponse(Response):
    """Loads solved on x, y, depth for each tool, and the curve from load to reading."""

    def __init__(
        self, x: np.ndarray, y: np.ndarray, depth: np.ndarray, load: np.ndarray, force: np.ndarray,
        curve_load: np.ndarray, curve_signal: np.ndarray, gain: np.ndarray, offset: np.ndarray, tools: tuple[str, ...],
    ) -> None:  # fmt: skip
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
        """
        self.x, self.y, self.depth, self.tools = x, y, depth, tools
        self._curve = curve_load, curve_signal
        self.gain, self.offset = gain, offset
        self._rough = False
        both = np.concatenate([load, force[..., None]], axis=-1)
        # Splines with mirrored ends, one more node around, so that the four nodes of a place always exist.
        self._splines = [
            np.pad(
                np.stack([spline_filter(both[t, ..., c], order=3) for c in range(both.shape[-1])], axis=-1),
                ((1, 2), (1, 2), (1, 2), (0, 0)), mode="reflect",
            )
            for t in range(len(both))
        ]  # fmt: skip
        self._nodes = [np.pad(table, ((1, 2), (1, 2), (1, 2), (0, 0)), mode="reflect") for table in both]
        self._kept: dict[int, _Answer] = {}

    @property
    def spacing(self) -> float:
        """Largest distance between successive depths [mm]."""
        return float(np.diff(self.depth).max())

    def rougher(self) -> TableResponse:
        """Return the same table read by polynomials through four nodes: off the splines by about the splines' error."""
        other = copy.copy(self)
        other._rough, other._kept = True, {}
        return other

    @classmethod
    def read(cls, path: Path) -> TableResponse:
        """Read a table.

        Raises:
            UsageError: If there is no such file.
            FormatError: If it is no such table.
        """
        if not path.is_file():
            raise UsageError(f"no file {path}", "a response table (.npz)", "check response/file in the model spec")
        try:
            with np.load(path, allow_pickle=False) as data:
                values = {name: data[name] for name in FIELDS}
        except (ValueError, KeyError, OSError) as error:
            raise FormatError(
                f"{path} is no response table ({error})", f"an .npz file with {', '.join(FIELDS)}", "make it again"
            ) from None
        tools = tuple(str(name) for name in values.pop("tools"))
        return cls(**values, tools=tools)

    def idling_at(self, offset: np.ndarray) -> TableResponse:
        """Return the same response with other readings without load, shape (channels,)."""
        other = copy.copy(self)
        other.offset, other._kept = offset, {}
        return other

    def with_tools(self, order: list[int]) -> TableResponse:
        """Return the same response with its tools in another order, or fewer."""
        other = copy.copy(self)
        other._splines, other._nodes = [self._splines[k] for k in order], [self._nodes[k] for k in order]
        other.tools, other._kept = tuple(self.tools[k] for k in order), {}
        return other

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the load on each channel, shape (n, channels)."""
        return self._both(pose, tool).load

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the normal force [N], shape (n,)."""
        return self._both(pose, tool).force

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return readings, shape (n, channels); the curve is continued straight beyond its ends."""
        known = next((answer for answer in self._kept.values() if answer.load is load), None)
        if known is not None and known.signal is not None:
            return known.signal
        at, value = self._curve
        low, high = (value[1] - value[0]) / (at[1] - at[0]), (value[-1] - value[-2]) / (at[-1] - at[-2])
        result = np.interp(load, at, value)
        if load.min(initial=at[0]) < at[0]:
            result += low * np.minimum(load - at[0], 0.0)
        if load.max(initial=at[-1]) > at[-1]:
            result += high * np.maximum(load - at[-1], 0.0)
        result *= self.gain
        result += self.offset
        if known is not None:
            known.signal = _locked(result)
        return result

    def _both(self, pose: np.ndarray, tool: np.ndarray) -> _Answer:
        key = hash((pose.tobytes(), tool.tobytes()))
        if key in self._kept:
            return self._kept[key]
        result = np.zeros((len(pose), self._splines[0].shape[-1]))
        touching = pose[:, 2] > 0
        weights = _lagrange if self._rough else _spline
        for t, table in enumerate(self._nodes if self._rough else self._splines):
            rows = np.flatnonzero(touching & (tool == t))
            if len(rows):
                result[rows] = _cubic(table, self._places(pose[rows]), weights)
        if len(self._kept) >= KEPT:
            self._kept.pop(next(iter(self._kept)))
        self._kept[key] = _Answer(_locked(np.ascontiguousarray(result[:, :-1])), _locked(result[:, -1].copy()))
        return self._kept[key]

    def _places(self, pose: np.ndarray) -> np.ndarray:
        """Return places in units of nodes, kept inside the table, shape (n, 3)."""
        root = np.sqrt(np.maximum(pose[:, 2], 0.0)) / np.sqrt(self.depth[-1]) * (len(self.depth) - 1)
        column = (pose[:, 0] - self.x[0]) / (self.x[1] - self.x[0])
        row = (pose[:, 1] - self.y[0]) / (self.y[1] - self.y[0])
        last = np.array([len(self.x), len(self.y), len(self.depth)]) - 1.0
        return np.clip(np.stack([column, row, root], axis=-1), 0.0, last)


@dataclass
class _Answer:
    """What the table says of one course of poses."""

    load: np.ndarray
    force: np.ndarray
    signal: np.ndarray | None = None
    """Readings, once they were asked for."""


def _locked(values: np.ndarray) -> np.ndarray:
    """Return values that nobody may write into: others are given the same."""
    values.flags.writeable = False
    return values


def _spline(t: np.ndarray) -> np.ndarray:
    """Return the weights of four B-spline coefficients at a share of the way between the middle two."""
    return np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6


def _lagrange(t: np.ndarray) -> np.ndarray:
    """Return the weights of four nodes of the cubic through them."""
    back, on, two = t + 1, t - 1, t - 2
    return np.stack([-t * on * two / 6, back * on * two / 2, -back * t * two / 2, back * t * on / 6])


def _cubic(table: np.ndarray, place: np.ndarray, of: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return what a padded array of coefficients or nodes says at places [nodes], shape (n, channels)."""
    node = np.floor(place).astype(np.int64)
    weights = of(place - node).transpose(1, 0, 2)  # n, 4, axes
    _, b, c, channels = table.shape
    x, y, z = (node[:, axis, None] + np.arange(4) for axis in range(3))
    at = ((x[:, :, None, None] * b + y[:, None, :, None]) * c + z[:, None, None, :]).reshape(-1)
    each = weights[:, :, None, None, 0] * weights[:, None, :, None, 1] * weights[:, None, None, :, 2]
    rows = np.arange(len(place) + 1) * 64
    return csr_matrix((each.reshape(-1), at, rows), shape=(len(place), table[..., 0].size)) @ table.reshape(
        -1, channels
    )
