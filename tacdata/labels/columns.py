"""The columns of a label: names, units, types and shapes, and whether a label's arrays agree with them."""

from __future__ import annotations

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels.label import Label
from tacdata.sensor.protrusion_pixels import PIXELS

REQUIRED = {
    "time_ns": ("ns", "int64", "frame"),
    "tip": ("mm", "float64", "vector"),
    "signed": ("mm", "float32", "map"),
    "taxel_force": ("N", "float32", "taxels"),
    "taxel_closure": ("mm", "float32", "taxels"),
    "taxel_area": ("mm^2", "float32", "taxels"),
    "force": ("N", "float32", "vector"),
    "error_map": ("mm", "float16", "map"),
    "error": ("mm", "float32", "frame"),
    "force_error": ("N", "float32", "frame"),
}
"""Unit, type and kind of each column that every label has; the first axis is the frames."""
OPTIONAL = {
    "traction": ("MPa", "float16", "vector map"),
    "taxel_pressure": ("MPa", "float16", "taxel maps"),
    "interpolation_error": ("mm", "float32", "frame"),
    "uncertainty": ("mm", "float16", "map"),
    "force_uncertainty": ("N", "float32", "vector"),
    "taxel_force_uncertainty": ("N", "float32", "taxels"),
    "taxel_closure_uncertainty": ("mm", "float32", "taxels"),
    "taxel_capacitance": ("pF", "float32", "taxels"),
    "taxel_counts": ("counts", "float32", "taxels"),
}
"""The same of columns that a label has where something is known of them; else `Label` holds None."""
ALL = {**REQUIRED, **OPTIONAL}
UNITS = {name: unit for name, (unit, _, _) in ALL.items()}
DTYPES = {name: dtype for name, (_, dtype, _) in ALL.items()}
NDIM = {"frame": 1, "vector": 2, "taxels": 2, "map": 3, "vector map": 4, "taxel maps": 4}


def present(label: Label) -> tuple[str, ...]:
    """Return the columns that a label has."""
    return tuple(name for name in ALL if name in REQUIRED or getattr(label, name) is not None)


def shape(name: str, frames: int, pixels: tuple[int, int], taxels: int) -> tuple[int, ...]:
    """Return a column's shape."""
    kinds = {
        "frame": (),
        "vector": (3,),
        "taxels": (taxels,),
        "map": pixels,
        "vector map": (3, *pixels),
        "taxel maps": (taxels, PIXELS, PIXELS),
    }
    return (frames, *kinds[ALL[name][2]])


def check(label: Label, origin: str) -> None:
    """Refuse a label whose arrays contradict each other.

    Raises:
        FormatError: If shapes differ, a value is not finite, or time does not increase; ``origin`` names the label.
    """
    frames = len(label.time_ns)
    for name in present(label):
        _check_column(np.asarray(getattr(label, name)), name, frames, origin)
    if label.tip.shape[1] != 3 or label.force.shape[1] != 3:
        raise FormatError(
            f"{origin}: tip {label.tip.shape}, force {label.force.shape}", "three columns each", "correct the label"
        )
    pixels, taxels = label.signed.shape[1:], label.taxel_force.shape[1]
    wrong = {
        name: np.shape(getattr(label, name))
        for name in present(label)
        if np.shape(getattr(label, name)) != shape(name, frames, pixels, taxels)
    }
    if wrong:
        raise FormatError(
            f"{origin}: {taxels} taxels, maps {label.signed.shape}, but {wrong}",
            "the same number of taxels everywhere, one error a pixel",
            "correct the label",
        )
    if (np.diff(label.time_ns) <= 0).any():
        raise FormatError(f"{origin}: time_ns does not increase", "increasing times [ns]", "check the recording")


def _check_column(values: np.ndarray, name: str, frames: int, origin: str) -> None:
    ndim = NDIM[ALL[name][2]]
    if values.ndim != ndim or len(values) != frames or frames == 0:
        raise FormatError(
            f"{origin}: label.{name} has shape {values.shape}",
            f"{ndim} axes, the first of {max(frames, 1)} frames as in time_ns",
            "give every array of the label one row a frame",
        )
    if not np.isfinite(values).all():
        raise FormatError(
            f"{origin}: label.{name} holds values that are not finite",
            "finite values only",
            "a solve that failed is no label: store its reason instead",
        )
