"""Accuracy of two contacts near each other from one frame: the Cramer-Rao bound of the rig's own noise.

    python benchmarks/learning_curve/pair_limit.py [--rigs 3]

Two balls press the virtual rig side by side. Unknown are place and depth of each, six numbers; the skin is known. The
bound is the least spread that any unbiased estimate of these numbers has (H. Cramer, Mathematical Methods of
Statistics, 1946, ch. 32). A network does not know the skin, so it errs more; its error beyond the bound is not
noise. Contacts must not overlap: the forces of both are then added. One ball alone is listed, too, with three unknown
numbers.
"""

from __future__ import annotations

import argparse

import numpy as np
import run

from tacdata.indenters import Indenter, from_document
from tacdata.rig import Registration
from tacdata.sensor import Sensor, default_sensor
from tacdata.virtual_rig.world.world import World, draw

DEPTH = 0.7
"""Depth of each ball [mm], as the pairs of `rig_contacts.yaml` have on average."""
RADIUS = {3.0: 1.0, 4.0: 1.5, 5.0: 1.5, 6.0: 1.5}
"""Radius of both balls [mm] by their distance [mm]."""
STEP = 0.02
"""Step of the differences [mm]."""


class PairReadings:
    """Readings of a rig without noise, of balls that press side by side."""

    def __init__(self, rig: int, sensor: Sensor, radius: float) -> None:
        """Draw the rig's world."""
        self.world = World(draw(rig, sensor, Registration((0.0, 0.0, 0.0), 0.0)), sensor)
        self._ball, (self._turn, self._origin) = from_document({"shape": "sphere", "radius": radius}), self._axes()

    def counts(self, balls: np.ndarray) -> np.ndarray:
        """Return the change of the readings [counts], shape (taxels,), of balls (k, 3): place and depth [mm]."""
        tips = self._origin + balls @ self._turn.T
        return self._counts(sum(self.world.taxel_force(tip, self._ball, 0.0) for tip in tips))

    def of(self, state: np.ndarray, indenter: Indenter) -> np.ndarray:
        """Return the change of the readings [counts], shape (taxels,), of one indenter.

        Args:
            state: Place and depth [mm] and yaw [rad], shape (4,).
            indenter: The indenter.
        """
        tip = self._origin + state[:3] @ self._turn.T
        return self._counts(self.world.taxel_force(tip, indenter, float(np.degrees(state[3]))))

    def _counts(self, force: np.ndarray) -> np.ndarray:
        truth = self.world.truth
        closure = (force / truth.protrusion) ** (2 / 3)
        return np.array(truth.gain) * (1 / (1 - 0.8 * closure / (closure + truth.half_closure)) - 1)

    def bound(self, balls: np.ndarray, rate: float) -> np.ndarray:
        """Return the least covariance of the balls' numbers [mm^2], shape (3 k, 3 k), from one frame.

        Args:
            balls: Place and depth of each [mm], shape (k, 3).
            rate: Frames a second of the board [Hz].
        """
        truth, flat = self.world.truth, balls.reshape(-1)
        # Readings are tared over REST seconds, and zeros wander meanwhile, as in `noise_limit`.
        variance = truth.noise**2 * (1 + 1 / (run.REST * rate)) + truth.drift**2 / 12
        steps = STEP * np.eye(len(flat))
        slope = np.array(
            [
                (self.counts((flat + one).reshape(-1, 3)) - self.counts((flat - one).reshape(-1, 3))) / (2 * STEP)
                for one in steps
            ]
        )
        return np.linalg.inv(slope @ slope.T / variance)

    def _axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation and origin that put a place and a depth of the sensor where the carriage must stand [mm]."""
        registration = self.world.truth.registration
        origin = registration.to_sensor(np.zeros((1, 3)))[0]
        turn = np.linalg.inv(registration.to_sensor(np.eye(3)) - origin).T
        return turn, -turn @ origin


def main() -> None:
    """Print the bound of each distance, the median over places, yaws and rigs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=3)
    arguments = parser.parse_args()
    sensor, rng = default_sensor(), np.random.default_rng(0)
    pitch, rate = sensor.map.pixel_pitch, sensor.taxels.rate
    for distance, radius in RADIUS.items():
        errors: dict[int, list[np.ndarray]] = {1: [], 2: []}
        for rig in range(arguments.rigs):
            readings = PairReadings(rig, sensor, radius)
            for _ in range(20):
                yaw, (x, y) = rng.uniform(0, 2 * np.pi), rng.uniform((-3.0, -2.0), (3.0, 2.0))
                aside = 0.5 * distance * np.array([np.cos(yaw), np.sin(yaw)])
                both = np.array([[x - aside[0], y - aside[1], DEPTH], [x + aside[0], y + aside[1], DEPTH]])
                for count in errors:
                    drawn = rng.multivariate_normal(np.zeros(3 * count), readings.bound(both[:count], rate), 200)
                    errors[count].append(np.hypot(drawn[:, ::3], drawn[:, 1::3]).ravel() / pitch)
        one, two = (np.median(np.concatenate(found)) for found in errors.values())
        print(f"{distance:.0f} mm apart: one ball {one:.4f} px, each of two {two:.4f} px, ratio {two / one:.2f}")


if __name__ == "__main__":
    main()
