"""A pressed layer and the rig that holds it: from the rig's commanded depth to indentation and load."""

from dataclasses import dataclass

import numpy as np
from path import ONLY


@dataclass
class Skin:
    """One load of one place, which pulls at no tool."""

    stiffness: float = 1.2
    """[N/mm^power]"""
    power: float = 1.5
    """Of load over indentation [1]."""
    stiffening: float = 0.12
    """[1/mm^2]"""
    compliance: float = 0.0
    """By which the frame gives way [mm/N]."""
    play: float = 0.0
    """Of the guide [mm]."""
    memory: object = None
    """One of `memory`, or none."""

    def elastic(self, depth):
        """Return the load without a memory [N]."""
        if depth <= 0:
            return 0.0
        return self.stiffness * depth**self.power * (1 + self.stiffening * depth * depth)

    def energy(self, depth):
        """Return the energy of that load [mJ]."""
        if depth <= 0:
            return 0.0
        first, second = self.power + 1, self.power + 3
        return self.stiffness * (depth**first / first + self.stiffening * depth**second / second)

    def pressed(self, depths, place=ONLY):
        """Return indentations [mm] and loads [N], shape (n,), under commanded depths, a row a `STEP`."""
        if self.memory is not None:
            self.memory.begin(place)
        found, loads = np.empty(len(depths)), np.empty(len(depths))
        before = force = 0.0
        carriage = depths[0] + self.play / 2
        for i, said in enumerate(depths):
            carriage = min(max(carriage, said - self.play / 2), said + self.play / 2) if self.play else said
            depth, force = self._given_way(carriage, force)
            load = self.elastic(depth) if self.memory is None else self.memory.load(self, depth, before)
            found[i] = before = depth
            loads[i] = max(load, 0.0) if depth > 0 else 0.0
        return found, loads

    def _given_way(self, carriage, force):
        """Return the indentation [mm] and the load [N] that balance, by halving steps from the last load on."""
        if not self.compliance:
            return carriage, 0.0
        depth = carriage - self.compliance * force
        for _ in range(5):
            force = self.elastic(depth)
            depth = 0.5 * (depth + carriage - self.compliance * force)
        return depth, self.elastic(depth)
