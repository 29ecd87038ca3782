"""Curves, bars and maps as SVG, to be put into a page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from tacdata.discrepancy.plain_number import plain_number

WIDTH, HEIGHT = 360, 150
"""Of a chart [px]."""
LEFT, RIGHT, TOP, BOTTOM = 58, 8, 16, 26
"""Margins for axes [px]; on the left a number with its sign has room."""
MOST_POINTS = 400
"""Points of a curve that are drawn."""


def curves(
    title: str,
    across: np.ndarray,
    lines: Sequence[tuple[str, np.ndarray]],
    labels: tuple[str, str],
    band: float | None = None,
) -> str:
    """Return a chart of curves over one axis.

    Args:
        title: Above it.
        across: Shape (n,).
        lines: Class of the style sheet and values, shape (n,), of each curve.
        labels: Of the two axes, with units.
        band: Half width of a grey band about 0.
    """
    pick = np.unique(np.linspace(0, len(across) - 1, min(MOST_POINTS, len(across))).round().astype(int))
    every = np.concatenate([values[pick] for _, values in lines])
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 1.0)
    if band is not None:
        low, high = min(low, -1.5 * band), max(high, 1.5 * band)
    room = 0.05 * max(high - low, 1e-12)
    x, y = _Axis(across[pick], LEFT, WIDTH - RIGHT), _Axis(np.array([low - room, high + room]), HEIGHT - BOTTOM, TOP)
    parts = []
    if band is not None:
        top, bottom = y.at(band), y.at(-band)
        parts.append(
            f'<rect class="band" x="{LEFT}" y="{top:.1f}" width="{WIDTH - LEFT - RIGHT}" height="{bottom - top:.1f}"/>'
        )
    for kind, values in lines:
        parts.append(f'<polyline class="{kind}" points="{_points(x, y, across[pick], values[pick])}"/>')
    return _framed(title, parts, x, y, labels)


def shares_bar(parts: Sequence[tuple[str, str, float]]) -> str:
    """Return one bar of shares: class of the style sheet, name and share [1] of each."""
    whole, at, made = max(sum(share for _, _, share in parts), 1e-12), 0.0, []
    for kind, name, share in parts:
        wide = 720 * share / whole
        made.append(
            f'<rect class="{kind}" x="{at:.1f}" y="0" width="{wide:.1f}" height="26">'
            f"<title>{escape(name)}: {100 * share:.0f} %</title></rect>"
        )
        at += wide
    return f'<svg class="bar" viewBox="0 0 720 26" role="img">{"".join(made)}</svg>'


def map_of(title: str, rows: Sequence[str], columns: Sequence[str], values: np.ndarray, most: float) -> str:
    """Return a heat map of mean squares over the noise, shape (rows, columns); NaN where nothing was read.

    The deepest colour is ``most``: adjacent maps share it.
    """
    wide, high, first = 104, 24, 150
    parts = [
        f'<text x="{first + wide * (k + 0.5):.0f}" y="14" class="middle">{escape(name)}</text>'
        for k, name in enumerate(columns)
    ]
    for i, name in enumerate(rows):
        parts.append(f'<text x="0" y="{20 + high * i + 16}">{escape(name)}</text>')
        for k in range(len(columns)):
            value = float(values[i, k])
            if not np.isfinite(value):
                continue
            strength = float(np.clip(np.log(max(value, 1.0)) / np.log(most), 0, 1))
            x, y, ink = first + wide * k, 20 + high * i, "#fff" if strength > 0.5 else "#222"
            parts.append(
                f'<rect x="{x}" y="{y}" width="{wide - 2}" height="{high - 2}" class="heat" '
                f'style="fill-opacity:{0.08 + 0.8 * strength:.2f}"/>'
                f'<text x="{x + wide / 2:.0f}" y="{y + 15}" class="middle" style="fill:{ink}">'
                f"{plain_number(value, 3)}</text>"
            )
    size = f"0 0 {first + wide * len(columns)} {24 + high * len(rows)}"
    return _figure(title, size, "".join(parts))


class _Axis:
    """From values to pixels."""

    def __init__(self, values: np.ndarray, begin: float, end: float) -> None:
        known = values[np.isfinite(values)]
        self.low, self.high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        self._begin, self._scale = begin, (end - begin) / max(self.high - self.low, 1e-12)

    def at(self, value: float) -> float:
        """Return the place of a value [px]."""
        return self._begin + (value - self.low) * self._scale


def _points(x: _Axis, y: _Axis, across: np.ndarray, values: np.ndarray) -> str:
    good = np.isfinite(values)
    return " ".join(f"{x.at(a):.1f},{y.at(v):.1f}" for a, v in zip(across[good], values[good], strict=True))


def _framed(title: str, parts: list[str], x: _Axis, y: _Axis, labels: tuple[str, str]) -> str:
    """Return a chart with its frame, the ends of its axes and their names."""
    low, high = HEIGHT - BOTTOM, TOP
    ticks = [
        f'<text x="{LEFT}" y="{low + 12}">{plain_number(x.low, 3)}</text>',
        f'<text x="{WIDTH - RIGHT}" y="{low + 12}" class="end">{plain_number(x.high, 3)}</text>',
        f'<text x="{(LEFT + WIDTH) / 2:.0f}" y="{low + 22}" class="middle">{escape(labels[0])}</text>',
        f'<text x="{LEFT - 4}" y="{low}" class="end">{plain_number(y.low, 3)}</text>',
        f'<text x="{LEFT - 4}" y="{high + 6}" class="end">{plain_number(y.high, 3)}</text>',
        f'<text x="{LEFT}" y="{high - 5}">{escape(labels[1])}</text>',
    ]
    frame = f'<path class="frame" d="M{LEFT} {high}V{low}H{WIDTH - RIGHT}"/>'
    return _figure(title, f"0 0 {WIDTH} {HEIGHT}", f"{frame}{''.join(ticks)}{''.join(parts)}")


def _figure(title: str, size: str, inner: str) -> str:
    caption = f"<figcaption>{escape(title)}</figcaption>"
    return f'<figure>{caption}<svg viewBox="{size}" role="img">{inner}</svg></figure>'
