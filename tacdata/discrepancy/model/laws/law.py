"""Contents of a contact law's file: a class for the rise of readings with depth."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from tacdata import registry

ROOM, BASE = "tacdata.discrepancy.model.laws", "law"


class ContactLaw(ABC):
    """How readings rise with depth, but for a factor of each channel."""

    title: ClassVar[str]
    """Description, as a phrase."""
    source: ClassVar[str]
    """Where it comes from."""
    shapes: ClassVar[tuple[float, ...]] = (0.0,)
    """Values to try of its own number [1]; one of no meaning where it has none."""

    @abstractmethod
    def rise(self, depth: np.ndarray, shape: float) -> np.ndarray:
        """Return the rise [1], shape as the depth.

        Args:
            depth: Over the deepest of all, 0 or more [1].
            shape: Its own number [1].
        """

    def said(self, smallest: float, largest: float) -> str:
        """Return the law with its own number [1] in most channels and places, in words."""
        return self.title


def between(smallest: float, largest: float) -> str:
    """Return a range of numbers, or one where they are the same."""
    return f"{smallest:.2g}" if smallest == largest else f"{smallest:.2g} to {largest:.2g}"


def laws() -> tuple[ContactLaw, ...]:
    """Return every contact law, by name."""
    result = []
    for name in registry.names(ROOM, BASE):
        kind: type[ContactLaw] = registry.load(ROOM, BASE, name, ContactLaw)
        result.append(kind())
    return tuple(result)
