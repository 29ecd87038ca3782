"""From a value to a colour, the same in every backend and readable with any colour vision."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

# Okabe and Ito, "Color Universal Design" (2008), without black and yellow.
HUES = ((0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0))


@dataclass(frozen=True)
class ColorScale:
    """A linear scale between two values."""

    low: float
    """Value of the first colour [unit]."""
    high: float
    """Value of the last colour [unit]."""
    unit: str
    signed: bool = False
    """True for a scale with a middle: two hues that meet at zero; False for one that rises in lightness."""

    @property
    def colormap(self) -> str:
        """Name of the matplotlib colour map; both kinds keep their order without red-green vision."""
        return "PuOr" if self.signed else "viridis"

    def rgb(self, values: np.ndarray) -> np.ndarray:
        """Return colours, shape (*values.shape, 3), uint8; values beyond the ends get the end's colour, NaN black."""
        span = self.high - self.low
        place = 256 * (np.asarray(values) - self.low) / span
        valid = ~np.isnan(place)
        step = np.clip(np.where(valid, place, 0.0), 0, 255).astype(np.uint8)
        colors = _table(self.colormap)[step]
        if not valid.all():
            colors[~valid] = 0
        return colors


@cache
def _table(colormap: str) -> np.ndarray:
    # matplotlib has the same tables, and takes a third of a second to import
    table = np.loadtxt(Path(__file__).parent / "color_tables.csv", delimiter=",", dtype=np.uint8)
    return table[:, :3] if colormap == "viridis" else table[:, 3:]


def scale_of(values: np.ndarray, unit: str, signed: bool = False, floor: float = 0.0) -> ColorScale:
    """Return the scale that spans finite values, from 0 (or symmetrically around it) to two significant digits.

    Args:
        values: Values to colour [unit].
        unit: Unit to print.
        signed: Whether values of both signs matter.
        floor: Smallest end of the scale [unit], so that noise is not blown up to full colour.
    """
    finite = np.abs(values[np.isfinite(values)]) if signed else values[np.isfinite(values)]
    high = round_up(max(float(finite.max(initial=0.0)), floor, 1e-9))
    return ColorScale(-high if signed else 0.0, high, unit, signed)


def round_up(value: float) -> float:
    """Return a positive value rounded up to two significant digits, so that a scale ends where its data end."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    # A value that has two digits already must not be pushed one step up by rounding.
    return float(f"{np.ceil(value / unit * (1 - 1e-9)) * unit:.12g}")


def taxel_colors(columns: int, rows: int) -> np.ndarray:
    """Return one colour a taxel, shape (columns * rows, 3), uint8: a hue a row, darker to lighter along x."""
    base = np.array([HUES[j % len(HUES)] for j in range(rows)], dtype=float)
    shade = np.linspace(-0.35, 0.45, columns)[None, :, None] if columns > 1 else np.zeros((1, 1, 1))
    dark, light = (base[:, None, :] * (1 + np.minimum(shade, 0)), (255 - base[:, None, :]) * np.maximum(shade, 0))
    return np.rint(dark + light).reshape(-1, 3).astype(np.uint8)
