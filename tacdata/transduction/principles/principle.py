"""Base class of a transduction principle.

``tacdata/transduction/principles/my_principle.py`` defines one frozen dataclass derived from `Principle`. A sensor file
names it by its file's name under ``transduction/principle``. Its fields are its parameters, each with a default: one
number for all taxels, or one for each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from tacdata.errors import FormatError
from tacdata.transduction.loads import Loads

ROOM, BASE = "tacdata.transduction.principles", "principle"
PERMITTIVITY = 8.8541878188e-3
"""Vacuum permittivity [pF/mm] (CODATA 2022)."""

type Number = float | np.ndarray
"""One value for all taxels, or shape (taxels,)."""


@dataclass(frozen=True)
class Principle(ABC):
    """Base class: capacitance [pF] of each taxel as a function of its own loads."""

    @classmethod
    def from_numbers(cls, values: dict[str, Any]) -> Self:
        """Build the principle from the numbers of a sensor file.

        Raises:
            FormatError: If one is unknown, not a number, or out of its range.
        """
        names = {f.name for f in fields(cls)}
        name = cls.__module__.rsplit(".", 1)[-1]
        remedy = "correct transduction/parameters; `tacdata list principles` names them"
        if unknown := sorted(set(values) - names):
            raise FormatError(f"transduction {name} with {', '.join(unknown)}", ", ".join(sorted(names)), remedy)
        numbers: dict[str, Number] = {}
        for field, value in values.items():
            number = np.asarray(value)
            if number.dtype.kind not in "iuf" or number.ndim > 1 or not np.isfinite(number).all():
                raise FormatError(f"transduction {name}: {field} = {value!r}", "finite numbers", remedy)
            numbers[field] = number.astype(float) if number.ndim else float(number)
        result = cls(**numbers)
        if complaint := result.complaint():
            raise FormatError(f"transduction {name}: {complaint}", "a physical value", remedy)
        return result

    def complaint(self) -> str:
        """Return the fault of the parameters, as a sentence; empty if there is none."""
        return ""

    def not_positive(self, *names: str) -> str:
        """Return which of the named parameters are not above 0, as a sentence; empty if all are."""
        wrong = [n for n in names if np.min(getattr(self, n)) <= 0]
        return f"{', '.join(f'{n} = {np.min(getattr(self, n)):g}' for n in wrong)}; allowed is above 0" if wrong else ""

    @abstractmethod
    def capacitance(self, loads: Loads) -> np.ndarray:
        """Return the capacitance [pF], shape (n, taxels)."""

    @abstractmethod
    def derivatives(self, loads: Loads) -> Loads:
        """Return its derivatives with respect to force [pF/N], closure [pF/mm] and area [pF/mm^2]."""

    @abstractmethod
    def saturated(self, loads: Loads) -> np.ndarray:
        """Return where a larger load no longer changes the reading, shape (n, taxels), bool."""

    @abstractmethod
    def inverse(self, capacitance: np.ndarray, area: np.ndarray) -> Loads:
        """Return the loads for a capacitance [pF], NaN where it is not invertible; all of shape (n, taxels).

        Args:
            capacitance: Readings [pF].
            area: Contact areas [mm^2], for principles that need them.
        """
