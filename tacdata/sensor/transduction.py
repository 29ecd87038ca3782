"""A sensor's transduction as data: principle, parameters, gain and offset."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

from tacdata import provenance
from tacdata.errors import FormatError


@dataclass(frozen=True)
class Transduction:
    """Principle and its parameters; `tacdata.transduction` computes with them."""

    principle: str
    """File name in tacdata/transduction/principles."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """Parameters of the principle by name: one number for all taxels or a list with one for each. Missing ones keep
    their default.
    """
    gain: tuple[float, ...] = (1.0,)
    """Counts per change of capacitance [counts/pF]: one for all taxels, or one for each."""
    offset: tuple[float, ...] = (0.0,)
    """Reading without load [counts]: one for all taxels, or one for each."""
    full_scale: float | None = None
    """Largest reading of the electronics [counts]; readings are clipped to it and to 0. None for no limit."""

    @property
    def document(self) -> dict[str, Any]:
        """The transduction as its part of the sensor file."""
        document: dict[str, Any] = {"principle": self.principle}
        if self.parameters:
            document["parameters"] = dict(self.parameters)
        # As they were given: one number stays one, so the hash of a file is that of its content.
        document |= {"gain": _plain(self.gain), "offset": _plain(self.offset)}
        if self.full_scale is not None:
            document["full_scale"] = self.full_scale
        return document

    @cached_property
    def content_hash(self) -> str:
        """Hash of every value that can change a reading but no label."""
        return provenance.content_hash(self.document)

    @classmethod
    def from_document(cls, document: dict[str, Any], taxels: int, origin: str) -> Self:
        """Build a transduction from its part of a checked sensor file; ``origin`` names the file in errors.

        Raises:
            FormatError: If a list has not one number for each of the ``taxels``.
        """
        values = dict(document)
        listed = {"gain": values.get("gain"), "offset": values.get("offset"), **values.get("parameters", {})}
        for name, value in listed.items():
            # A single number holds for all taxels, and has no length to compare.
            if isinstance(value, list) and len(value) != taxels:
                raise FormatError(
                    f"{origin}: transduction: {name} has {len(value)} numbers for {taxels} taxels",
                    f"one number, or a list of {taxels}",
                    f"correct {name}",
                )
        for name in ("gain", "offset"):
            if name in values:
                values[name] = tuple(values[name]) if isinstance(values[name], list) else (values[name],)
        return cls(**values)


def _plain(numbers: tuple[float, ...]) -> float | list[float]:
    return numbers[0] if len(numbers) == 1 else list(numbers)
