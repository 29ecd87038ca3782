"""The columns of a label and the arrays of a solved path, read off their classes; whether a label agrees with them."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import get_type_hints

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels.label import Label, PathSolution
from tacdata.labels.quantity import Quantity


def _quantities(kind: type[Label | PathSolution], required: bool) -> dict[str, Quantity]:
    """Return the quantities of a class, in the order of its fields: those with a default are optional."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        field.name: quantity
        for field in fields(kind)
        if (field.default is MISSING) == required
        for quantity in getattr(hints[field.name], "__metadata__", ())
        if isinstance(quantity, Quantity)
    }


REQUIRED = _quantities(Label, required=True)
"""Columns that every label has; the first axis is the frames."""
OPTIONAL = _quantities(Label, required=False)
"""Columns that a label has if they are known; else `Label` holds None."""
ALL = {**REQUIRED, **OPTIONAL}
PATH_REQUIRED = _quantities(PathSolution, required=True)
"""Arrays that every solved path has; the first axis is the states."""
PATH_OPTIONAL = _quantities(PathSolution, required=False)
"""Arrays that older releases did not write, or that need a property of the sensor file; else None."""
PATH = {**PATH_REQUIRED, **PATH_OPTIONAL}


def present(label: Label) -> tuple[str, ...]:
    """Return the columns that a label has."""
    return tuple(name for name in ALL if name in REQUIRED or getattr(label, name) is not None)


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
        if np.shape(getattr(label, name)) != ALL[name].shape(frames, pixels, taxels)
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
    ndim = len(ALL[name].shape(frames, (1, 1), 1))
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
