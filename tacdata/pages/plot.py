"""Figures of curves and points; the data are in the page as JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from tacdata.errors import UsageError
from tacdata.pages.number import as_json

MOST_POINTS = 600
"""Points of a curve that are drawn."""
Style = Literal["line", "points", "both", "bars"]


@dataclass(frozen=True)
class Series:
    """One curve or set of points."""

    name: str
    values: Sequence[float] | np.ndarray
    """[the figure's unit], shape (n,); NaN where there is none."""
    color: str = "blue"
    """Of the style sheet: ink, blue, vermilion, green, purple, amber, sky or grey."""
    style: Style = "line"
    x: Sequence[float] | np.ndarray | None = None
    """Places where they differ from the figure's [its unit], shape (n,)."""
    low: Sequence[float] | np.ndarray | None = None
    """Lower ends of intervals [the figure's unit], shape (n,)."""
    high: Sequence[float] | np.ndarray | None = None
    """Upper ends of intervals [the figure's unit], shape (n,)."""
    width: float = 1.5
    """Width of the line [px]."""
    labels: Sequence[str] = ()
    """Words of each point."""


@dataclass(frozen=True)
class Band:
    """A grey range of values, for example a tolerance."""

    low: float
    high: float
    name: str


@dataclass(frozen=True)
class Plot:
    """A figure with hover values, zoom, and series that can be hidden."""

    title: str
    x_label: str
    """With its unit."""
    y_label: str
    """With its unit."""
    series: Sequence[Series]
    x: Sequence[float] | np.ndarray | None = None
    """Common places [the axis's unit], rising, shape (n,); None if each series has its places."""
    bands: Sequence[Band] = ()
    names: Sequence[str] = ()
    """Names of the places 0, 1, ..."""
    link: str = ""
    """Figures of one link share cursor and zoom."""
    least: float | None = None
    """Value that the axis shows at least [the figure's unit]."""
    most: int = MOST_POINTS
    """Points of a curve that are kept."""
    kind: ClassVar[str] = "plot"

    @property
    def frames(self) -> list[dict[str, Any]]:
        """The figure as data, in a list of one."""
        return [self.document]

    @property
    def document(self) -> dict[str, Any]:
        """The figure as data.

        Raises:
            UsageError: If a series is not as long as its places.
        """
        # The script in the page would draw a wrong length without a word.
        for series in self.series:
            places = series.x if series.x is not None else self.x
            if places is None or len(places) != len(series.values):
                count = "no" if places is None else str(len(places))
                raise UsageError(
                    f"series {series.name!r} of figure {self.title!r}: {len(series.values)} values at {count} places",
                    "as many values as places",
                    "give x to the figure or the series",
                )
        # All series of common places are thinned alike, or the cursor would show values of different places.
        pick = None if self.x is None else picked(len(self.x), self.most)
        return {
            "title": self.title,
            "x": {"label": self.x_label, "values": None if self.x is None else np.asarray(self.x)[pick]},
            "y": self.y_label,
            "series": [
                _series(series, pick if series.x is None else picked(len(series.values), self.most))
                for series in self.series
            ],
            "bands": [{"low": b.low, "high": b.high, "name": b.name} for b in self.bands],
            "names": list(self.names),
            "link": self.link,
            "least": self.least,
        }

    @property
    def data(self) -> str:
        """The figure's JSON."""
        return as_json(self.frames)


@dataclass(frozen=True)
class Slider:
    """Several figures under one slider, for example of presses."""

    label: str
    """What the slider counts, for example "press"."""
    names: Sequence[str]
    """Name of each position."""
    panels: Sequence[Sequence[Plot]]
    """Figures side by side, each with one plot a position."""
    kind: ClassVar[str] = "slider"

    @property
    def data(self) -> list[str]:
        """JSON of each panel."""
        return [as_json([plot.document for plot in panel]) for panel in self.panels]


def picked(count: int, limit: int) -> np.ndarray:
    """Return the indices of the points that are drawn, evenly spread, int, shape (m,)."""
    return np.unique(np.linspace(0, count - 1, min(limit, count)).round().astype(int)) if count else np.zeros(0, int)


def _series(series: Series, pick: np.ndarray | None) -> dict[str, Any]:
    document: dict[str, Any] = {
        "name": series.name,
        "color": series.color,
        "style": series.style,
        "width": series.width,
    }
    for name in ("values", "x", "low", "high"):
        values = getattr(series, name)
        if values is not None:
            document[name] = np.asarray(values, dtype=float)[pick]
    if series.labels:
        document["labels"] = [series.labels[int(k)] for k in pick] if pick is not None else list(series.labels)
    return document
