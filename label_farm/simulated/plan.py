"""The plan of a simulated dataset: the ranges that shapes, presses, specimens and noise are drawn from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.paths import StrPath

DEFAULT = Path(__file__).parent / "random_presses.yaml"
"""The plan that ships."""

type Range = tuple[float, float]
"""Lowest and highest value; equal where nothing is drawn."""

_OWN = ("shape", "weight", "depth")
"""Entries of a shape that are none of its sizes."""


@dataclass(frozen=True)
class DrawnShape:
    """A shape whose sizes are drawn."""

    name: str
    """The plan's name for it."""
    sizes: dict[str, Any]
    """The indenter's document with ranges [mm, deg] in place of its sizes."""
    weight: float
    """Relative weight of its draws [1]."""
    depth: Range
    """Depths of its presses [mm]."""


@dataclass(frozen=True)
class SpecimenSpread:
    """Differences between the specimens of one design."""

    count: int = 1
    """Number of specimens [count]."""
    skin: bool = True
    """Whether the skin varies by the sensor file's uncertainty."""
    gain: float = 0.0
    """Standard deviation of each channel's gain over the gain [1]."""
    shared_gain: float = 0.0
    """Standard deviation of the gain that all channels share, over the gain [1]."""
    offset: float = 0.0
    """Standard deviation of each channel's reading without load [counts]."""
    parameters: dict[str, float] = field(default_factory=dict)
    """Parameter of the transduction -> its standard deviation over its value [1]."""


@dataclass(frozen=True)
class ReadingNoise:
    """Noise, drift and rounding of readings, on top of the transduction."""

    readings: float = 0.0
    """Standard deviation of each reading [counts]."""
    drift: float = 0.0
    """Random walk of each channel's offset [counts/sqrt(s)]."""
    quantum: float = 1.0
    """Step that readings are rounded to [counts]; 0 for none."""


@dataclass(frozen=True)
class SimulationPlan:
    """Distribution of a simulated dataset.

    Example:
        >>> from tacdata.label_farm.simulated.plan import DEFAULT, read_simulation_plan
        >>> plan = read_simulation_plan(DEFAULT)
        >>> plan.depth, plan.specimens.count
        ((0.1, 1.2), 4)
    """

    name: str
    shapes: tuple[DrawnShape, ...]
    depth: Range
    """Deepest point of a press [mm]."""
    speed: Range
    """Loading and unloading speed [mm/s]."""
    hold: Range
    """Time at full depth [s]."""
    rest: Range
    """Time without contact before the press [s]."""
    recovery: Range
    """Time without contact after the press [s]."""
    yaw: Range
    """Rotation of the indenter about its axis [deg]."""
    tilt: Range
    """Lean of the indenter about x, and likewise about y [deg]."""
    rim: float
    """Least distance of the indenter at full depth from the skin's rim [mm]."""
    load_step: float
    """Largest step between solved states [mm]."""
    specimens: SpecimenSpread
    noise: ReadingNoise
    document: dict[str, Any]
    """The file's document, unchanged."""

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> SimulationPlan:
        """Build a plan from a parsed file; ``origin`` names it in errors.

        Raises:
            FormatError: If it breaks the schema, or a range is impossible.
        """
        documents.check(document, "simulation_plan", origin)
        times = {name: as_range(document[name], f"{origin}: {name}") for name in ("hold", "rest", "recovery")}
        depth, speed = (_above_zero(document, name, origin) for name in ("depth", "speed"))
        if times["rest"][0] <= 0:
            raise FormatError(
                f"{origin}: rest of {times['rest'][0]:g} s", "above 0 s: readings are tared in it", "rest longer"
            )
        shapes = tuple(
            DrawnShape(
                name,
                {key: value for key, value in entry.items() if key == "shape" or key not in _OWN},
                entry.get("weight", 1.0),
                _above_zero(entry, "depth", f"{origin}: shapes/{name}") if "depth" in entry else depth,
            )
            for name, entry in document["shapes"].items()
        )
        return cls(
            document["name"],
            shapes,
            depth,
            speed,
            **times,
            yaw=as_range(document.get("yaw", 0.0), f"{origin}: yaw"),
            tilt=as_range(document.get("tilt", 0.0), f"{origin}: tilt"),
            rim=document.get("rim", 0.3),
            load_step=document.get("load_step", 0.25),
            specimens=SpecimenSpread(**document.get("specimens", {})),
            noise=ReadingNoise(**document.get("noise", {})),
            document=document,
        )


def read_simulation_plan(path: StrPath) -> SimulationPlan:
    """Read a plan file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    path = Path(path)
    return SimulationPlan.from_document(documents.read(path, "simulation_plan"), str(path))


def as_range(value: float | list[float], origin: str) -> Range:
    """Return a number or a pair of numbers as a range.

    Raises:
        FormatError: If the lowest is above the highest, or one is not finite.
    """
    low, high = value if isinstance(value, list) else (value, value)
    if not (np.isfinite([low, high]).all() and low <= high):
        raise FormatError(f"{origin}: {low:g} to {high:g}", "[lowest, highest]", "exchange or correct them")
    return float(low), float(high)


def _above_zero(document: dict[str, Any], name: str, origin: str) -> Range:
    interval = as_range(document[name], f"{origin}: {name}")
    if interval[0] <= 0:
        raise FormatError(f"{origin}: {name} from {interval[0]:g}", "above 0", f"raise the lowest {name}")
    return interval
