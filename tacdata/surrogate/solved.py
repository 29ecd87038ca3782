"""One solved press, loading only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.transduction import Loads


@dataclass(frozen=True)
class Solved:
    """One press, loading only."""

    depths: np.ndarray
    """Depth of each state [mm], shape (k,), rising from 0."""
    loads: Loads
    """Loads of each state, shapes (k, taxels)."""
    normal: np.ndarray
    """Normal force on the indenter [N], shape (k,)."""
    seconds: float
    """Time of the solution [s]; 0 if unknown."""
    ended: bool = False
    """Whether the press was requested deeper but found no equilibrium."""

    def down_to(self, depths: Sequence[float]) -> Solved | None:
        """Return the states at these depths [mm], from the first; None if they were not solved.

        A press that ended early returns its states so far.
        """
        count = min(len(depths), len(self.depths)) if self.ended else len(depths)
        if len(self.depths) < count or not np.allclose(self.depths[:count], depths[:count], atol=1e-6):
            return None
        cut = Loads(*(values[:count] for values in vars(self.loads).values()))
        share = count / len(self.depths)
        return Solved(self.depths[:count], cut, self.normal[:count], self.seconds * share, self.ended)
