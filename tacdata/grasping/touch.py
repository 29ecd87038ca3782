"""Readings of a fingertip that presses on the orange with a given force: solved presses, interpolated, and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from tacdata.grasping.press_set import PressSet
from tacdata.grasping.presses import orange_places
from tacdata.sensor import Sensor


class OrangeTouch:
    """Readings by position and force; the skin is symmetric, so a quarter of it is solved."""

    def __init__(self, presses: PressSet, sensor: Sensor) -> None:
        """Arrange the presses of `presses.orange_presses` on their grid."""
        x, y = orange_places()
        grid = (len(x), len(y), presses.depths.shape[1])
        self.sensor, self.limit = sensor, (float(x[-1]), float(y[-1]))
        self._depths = presses.depths[0]
        self._normal = RegularGridInterpolator((x, y), presses.normal.reshape(grid))
        self._signals = RegularGridInterpolator((x, y), presses.signals(sensor).reshape(*grid, -1))

    def reaches(self, x: float, y: float) -> bool:
        """Return whether an orange at this position [mm] touches the skin inside the solved area."""
        return abs(x) <= self.limit[0] and abs(y) <= self.limit[1]

    def depth(self, x: float, y: float, force: float) -> float:
        """Return the depth [mm] at which the orange presses with a normal force [N]; NaN beyond the deepest state."""
        # Interpolated forces may fall by rounding, and np.interp needs an ascent.
        forces = np.maximum.accumulate(self._normal((abs(x), abs(y))))
        return float(np.interp(force, forces, self._depths, right=np.nan))

    def signals(self, x: float, y: float, force: float) -> np.ndarray:
        """Return tared readings without noise [counts], shape (taxels,).

        Args:
            x: Position of the orange on the pad [mm, sensor frame].
            y: The same across [mm].
            force: Normal force [N].
        """
        depth = self.depth(x, y, force)
        levels = self._signals((abs(x), abs(y)))
        readings = np.array([np.interp(depth, self._depths, levels[:, k]) for k in range(levels.shape[1])])
        return mirrored(readings, self.sensor, x < 0, y < 0)


def mirrored(values: np.ndarray, sensor: Sensor, over_x: bool, over_y: bool) -> np.ndarray:
    """Return readings (..., taxels) of the press mirrored along x, y or both."""
    array = values.reshape(*values.shape[:-1], sensor.taxels.rows, sensor.taxels.columns)
    array = array[..., ::-1] if over_x else array
    array = array[..., ::-1, :] if over_y else array
    return array.reshape(values.shape)


@dataclass(frozen=True)
class FingertipSpread:
    """Random differences of a fingertip from the sensor file, and between frames."""

    gain: float = 0.03
    """Standard deviation of each taxel's gain [1]."""
    noise: float = 5.0
    """Standard deviation of a reading [counts]."""
    drift: float = 4.0
    """Standard deviation of a reading's drift since it was tared [counts]."""
    mount: float = 0.2
    """Standard deviation of the sensor's position on its finger, along x and y [mm]."""


class Fingertip:
    """One of two fingertips; its position and taxel errors are drawn once."""

    def __init__(self, touch: OrangeTouch, spread: FingertipSpread, side: int, rng: np.random.Generator) -> None:
        """Draw it.

        Args:
            touch: The skin's answer.
            spread: Standard deviations of its differences.
            side: +1 if the sensor's x runs with the gripper's lateral direction, -1 if against it.
            rng: Random generator of everything, noise too.
        """
        count = touch.sensor.taxels.count
        self.side, self._touch, self._spread, self._rng = side, touch, spread, rng
        self._gain = rng.normal(1.0, spread.gain, count)
        self._mount = rng.normal(0.0, spread.mount, 2)

    def frames(self, lateral: float, vertical: float, force: float, count: int) -> np.ndarray:
        """Return tared readings [counts], shape (count, taxels); noise only where the orange is beyond the skin.

        Args:
            lateral: Position of the orange in the gripper's frame [mm].
            vertical: The same upwards [mm].
            force: Normal force [N].
            count: Frames.
        """
        x, y = self.side * lateral - self._mount[0], vertical - self._mount[1]
        taxels = self._touch.sensor.taxels.count
        clean = np.zeros(taxels)
        if self._touch.reaches(x, y):
            clean = self._gain * self._touch.signals(x, y, force)
        wander = self._rng.normal(0.0, self._spread.drift, taxels)
        return clean + wander + self._rng.normal(0.0, self._spread.noise, (count, taxels))
