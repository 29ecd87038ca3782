"""Maps of values over a plane, drawn pixel by pixel; the data are in the page as JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from tacdata.pages.number import as_json


@dataclass(frozen=True)
class PixelMap:
    """A map with hover values. Maps of one link share their cursor."""

    title: str
    values: np.ndarray
    """[unit], shape (rows, columns); row 0 is drawn at the bottom; NaN where there is none."""
    unit: str
    low: float
    """Value of the palette's first colour [unit]."""
    high: float
    """Value of its last [unit]."""
    extent: tuple[float, float, float, float] | None = None
    """Ends along x, then along y [mm]; None for plain numbers of columns and rows."""
    marks: Sequence[tuple[float, float]] = ()
    """Places of crosses [mm]."""
    labels: Sequence[Sequence[str]] = ()
    """Words of each pixel."""
    palette: Literal["depth", "diverging"] = "depth"
    aspect: float = 1.0
    """Height of a pixel over its width [1]."""
    link: str = ""
    kind: ClassVar[str] = "map"

    @property
    def data(self) -> str:
        """The map's JSON."""
        document: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("title", "values", "unit", "low", "high", "extent", "palette", "aspect", "link")
        }
        return as_json([document | {"marks": list(self.marks), "labels": [list(row) for row in self.labels]}])
