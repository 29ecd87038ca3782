"""Closed loop by touch: fingertips press until the live estimate of depth, or the live reading, is the recorded one.

The controller knows the stiffness of robot and skin of the undisturbed scene, not of the drawn one. Its estimate is
late and wrong as measured of a network (docs/how_to/hands.md): too shallow by a constant, with scatter. A reading is
off by the gain of its unit instead.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

LATENCY = 0.13
"""Latency of a live estimate [s]: four frames of a centred window of nine at 30 Hz (paper, Exp. 3)."""
SHALLOW, SCATTER = 0.23, 0.04
"""Largest constant error towards 0, and standard deviation of the scatter of a predicted depth [mm]."""
UNLIKE = 0.2
"""Largest relative deviation of a unit's gain from the usual one [1]."""
BANDWIDTH = 3.0
"""Rate at which the error of depth is corrected [1/s]; with `LATENCY` the phase margin is 68 degrees."""
RELEASE = 10.0
"""Rate at which the correction decays once the person lets go [1/s]."""
MOST = 0.03
"""Largest correction along the normal [m]."""
MOST_INWARD = -0.01
"""Largest correction away from the object [m]."""
SHARED = 0.5
"""Least sum of squared cosines between the normals and a direction along which fingers together move an object [1].

Two opposed fingers have 2 along their line. Normals that scatter by 20 degrees about it have 0.2 across.
"""


@dataclass
class DepthFeedback:
    """The controller of one replay."""

    goal: np.ndarray
    """Depth that the person felt [m], shape (n, f)."""
    seconds: np.ndarray
    """Times of the goal [s], shape (n,)."""
    outward: np.ndarray
    """Normals out of the pads [1], shape (n, f, 3)."""
    softness: float
    """Displacement of a target per depth of the skin, 1 + skin / robot, of the undisturbed scene [1]."""
    seed: int
    """Decides the errors of the live estimate."""
    raw: bool = False
    """Whether readings are fed back in place of depth; the goal is then a reading over the usual gain [m]."""

    def __post_init__(self) -> None:
        """Draw the errors of the estimate."""
        # Random numbers of its own: the same seed draws the same scene with and without feedback.
        self._rng = np.random.default_rng([self.seed, 31])
        count = self.goal.shape[1]
        self._shallow = 0.0 if self.raw else self._rng.uniform(0, SHALLOW, count) / 1000
        self._gain = self._rng.uniform(1 - UNLIKE, 1 + UNLIKE, count) if self.raw else 1.0
        self._correction = np.zeros(count)
        self._waiting: deque[tuple[float, np.ndarray]] = deque()
        self._estimate = np.zeros(count)

    def shift(self, moment: float, depth: np.ndarray, step: float) -> np.ndarray:
        """Return how the pads' targets are moved [m], shape (f, 3).

        Args:
            moment: Time [s].
            depth: Depth of each pad's skin [m], shape (f,).
            step: Time since the last call [s].
        """
        noise = self._rng.normal(0, SCATTER / 1000, len(depth)) * (depth > 0)
        self._waiting.append(
            (moment + LATENCY, np.clip(self._gain * depth - self._shallow * (depth > 0) + noise, 0, None))
        )
        # Estimates arrive in order, each after its latency.
        while self._waiting and self._waiting[0][0] <= moment:
            self._estimate = self._waiting.popleft()[1]
        row = min(int(np.searchsorted(self.seconds, moment)), len(self.seconds) - 1)
        goal = self.goal[row]
        pressing = goal > 0
        rate = BANDWIDTH * self.softness * (goal - self._estimate)
        if pressing.any() and (self._estimate[pressing] > 0).all():
            rate = squeezing(rate * pressing, self.outward[row] * pressing[:, None])
        self._correction += step * np.where(pressing, rate, -RELEASE * self._correction)
        self._correction = np.clip(self._correction, MOST_INWARD, MOST)
        return self._correction[:, None] * self.outward[row]


def squeezing(rate: np.ndarray, outward: np.ndarray) -> np.ndarray:
    """Return the part of velocities that presses the object, without the part that carries it along.

    Forces of the pads balance. So errors that differ between fingers can never all vanish, and a loop for each finger
    would carry the object away without end.

    Args:
        rate: Velocity of each finger along its normal [m/s], shape (f,); 0 for one that does not press.
        outward: Normals out of the pads [1], shape (f, 3); 0 for one that does not press.
    """
    modes, strength, _ = np.linalg.svd(outward, full_matrices=False)
    # Fingers that all press to one side press against a support, which does not give way.
    opposed = (modes.min(axis=0) < 0) & (modes.max(axis=0) > 0)
    carried = modes[:, opposed & (strength**2 > SHARED)]
    return rate - carried @ (carried.T @ rate)
