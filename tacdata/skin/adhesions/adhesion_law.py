"""Base class of the laws of adhesion, and the contents of a law's file.

``tacdata/skin/adhesions/my_law.py`` defines one class derived from `AdhesionLaw`, without parameters of its own: work w
and range d come from the sensor file's ``contact/adhesion``. A law is written in s = gap / d: the attraction is a
traction of w / d times `shape(s)`, whose integral over s from 0 to infinity is 1. At s <= 0 (touching) it holds its
value at 0, and contact carries the difference.
"""

from abc import ABC, abstractmethod
from functools import cache
from typing import ClassVar

from tacdata import registry
from tacdata.warp_runtime import wp

ROOM, BASE = "tacdata.skin.adhesions", "adhesion_law"


class AdhesionLaw(ABC):
    """Attractive traction by gap."""

    reach: ClassVar[float]
    """Gap over the range beyond which the traction counts as none [1]."""

    @staticmethod
    @abstractmethod
    @cache
    def functions() -> tuple[wp.Function, wp.Function, wp.Function]:
        """Return Warp functions of s >= 0, float64 [1]: shape f(s), its derivative f'(s), its integral from s on."""


def load_adhesion_law(name: str) -> type[AdhesionLaw]:
    """Return the law of a file.

    Raises:
        UsageError: If there is no such file.
    """
    return registry.load(ROOM, BASE, name, AdhesionLaw)
