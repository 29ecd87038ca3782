"""Base class of a strategy.

``tacdata/grasping/strategies/my_way.py`` defines one class derived from `Strategy`. ``tacdata grasp-study`` gives it
the same oranges, fingertips and noise as all others in this folder. It gets readings only, never the truth.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from tacdata import registry
from tacdata.grasping.centre import Maps
from tacdata.sensor import Sensor

ROOM, BASE = "tacdata.grasping.strategies", "strategy"


class Strategy(ABC):
    """Base class: estimates where one fingertip touches."""

    adjusts = True
    """Whether the estimate depends on where the contact is; without that the arm never moves."""

    def __init__(self, sensor: Sensor, maps: Maps) -> None:
        """Keep the fingertip's sensor, and the network that estimates depth maps from its readings."""
        self.sensor, self.maps = sensor, maps

    @abstractmethod
    def centre(self, frames: np.ndarray) -> np.ndarray | None:
        """Return the contact's centre, x and y in the sensor's frame [mm], shape (2,); None without a contact.

        Args:
            frames: Tared readings of one window [counts], shape (n, taxels).
        """


def names() -> list[str]:
    """Return the names of all strategies, sorted."""
    return registry.names(ROOM, BASE)


def create(name: str, sensor: Sensor, maps: Maps) -> Strategy:
    """Return a strategy by name.

    Raises:
        UsageError: If there is no such file.
    """
    kind: type[Strategy] = registry.load(ROOM, BASE, name, Strategy)
    return kind(sensor, maps)
