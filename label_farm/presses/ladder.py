"""The depths at which a press is solved: fine where contact begins, then in steps of at most a limit.

On its way up a skin on a board adds little information to its way down (decision 0024): few states are solved
there. The model adds states where these turn out too few (`Tolerance`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.errors import UsageError
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.sensor.sensor import ContactProperties

FINEST = 0.001
"""Least step that may be requested [mm]: far below the resolution of any mesh, and a path has few enough states."""


@dataclass(frozen=True)
class Ladder:
    """How a path's states are spaced. Steps grow geometrically from the first contact up to the limit."""

    first_step: float = 0.08
    """Step next to zero depth [mm]: contact grows fastest there, so the map bends most."""
    growth: float = 1.8
    """Ratio of one step to the step before [1]."""
    load_step: float = 0.25
    """Largest step while loading [mm]."""
    unload_step: float = 0.75
    """Step while unloading [mm], as nearly as states of the way down allow; up to ``load_step`` it is the largest."""
    tolerance: Tolerance | None = field(default_factory=Tolerance)
    """Where states are to be added; None for nowhere."""

    def __post_init__(self) -> None:
        """Refuse settings that make no ladder.

        Raises:
            UsageError: If a step is below `FINEST` or the steps would shrink.
        """
        steps = (self.first_step, self.load_step, self.unload_step)
        if not (min(steps) >= FINEST and np.isfinite(steps).all() and 1 <= self.growth < np.inf):
            raise UsageError(
                f"depth steps {steps} mm growing by {self.growth}",
                f"steps of {FINEST:g} mm or more and a growth of at least 1",
                "correct the steps",
            )

    def depths(self, deepest: float, other_way_up: bool = False) -> tuple[float, ...]:
        """Return the states of a path from 0 down to ``deepest`` [mm] and back to 0.

        Args:
            deepest: Depth [mm].
            other_way_up: Whether the way up is known to be another one (`goes_up_otherwise`): all steps are taken.
        """
        load = self._rungs(deepest, self.load_step)
        if other_way_up or self.unload_step <= self.load_step:
            unload = self._rungs(deepest, min(self.load_step, self.unload_step))
        else:
            unload = self._some(load)
        return (0.0, *load, *unload[-2::-1], 0.0)

    def _some(self, load: list[float]) -> list[float]:
        """Return those of the way down, rising, that cut it into steps of about the limit, into two at the least."""
        *shallower, deepest = load
        parts = max(2, int(np.ceil(deepest / self.unload_step)))
        targets = [deepest * k / parts for k in range(1, parts)]
        near = {min(shallower, key=lambda rung, at=at: abs(rung - at)) for at in targets if shallower}
        return [*sorted(near), deepest]

    def _rungs(self, deepest: float, limit: float) -> list[float]:
        steps, step = [], min(self.first_step, limit)
        while sum(steps) < deepest * (1 - 1e-12):
            steps.append(step)
            step = min(step * self.growth, limit)
        # Shrinking all steps by one factor meets the deepest point exactly and keeps every step within its limit.
        rungs = np.cumsum(steps) * (deepest / sum(steps))
        return [*(round(float(rung), 6) for rung in rungs[:-1]), round(deepest, 6)]


def goes_up_otherwise(contact: ContactProperties) -> bool:
    """Whether a skin bears another load on its way up: it sticks, or it rubs and is held from below.

    Held from below it slips under the shape and then bears up to 7 % less; on a board it does not.
    """
    return contact.adhesion is not None or (contact.friction > 0 and "bottom" in contact.bonded)
