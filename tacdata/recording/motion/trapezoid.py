"""The commanded path of a motion controller: one acceleration-limited straight move from rest to rest.

GRBL (doc/markdown/settings.md, $110-$112 and $120-$122) limits speed and acceleration per axis. Along a straight move
the axis that reaches its own limit first decides. Speed rises linearly, stays, falls linearly. A move too short for the
commanded speed is a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

KNOTS_PER_RAMP = 24
"""Knots of a ramp when it is returned as a polyline; the error is a t^2 / 8 per knot interval t."""


@dataclass(frozen=True)
class Trapezoid:
    """A straight move from rest to rest."""

    start: np.ndarray
    """Machine position before [mm], shape (3,)."""
    target: np.ndarray
    """Machine position after [mm], shape (3,)."""
    speed: float
    """Speed limit along the move [mm/s]."""
    acceleration: float
    """Acceleration limit along the move [mm/s^2]."""

    @cached_property
    def length(self) -> float:
        """Length of the move [mm]."""
        return float(np.linalg.norm(self.target - self.start))

    @property
    def peak(self) -> float:
        """Largest speed reached [mm/s]: min(v, sqrt(a L))."""
        return min(self.speed, float(np.sqrt(self.acceleration * self.length)))

    @property
    def ramp(self) -> float:
        """Duration of one ramp [s]."""
        return self.peak / self.acceleration

    @property
    def duration(self) -> float:
        """Duration of the move [s]: L / v + v / a, or 2 sqrt(L / a) for a triangle."""
        return self.length / self.peak + self.ramp if self.length else 0.0

    def distance(self, time: np.ndarray) -> np.ndarray:
        """Return the distance travelled [mm] at times since the start [s], shape (n,); clamped."""
        t = np.clip(np.asarray(time, dtype=float), 0.0, self.duration)
        if not self.length:
            return np.zeros_like(t)
        remainder = self.duration - t
        # A ramp covers half of the distance of a cruise as long.
        cruise = self.peak * (t - self.ramp / 2)
        rising, falling = self.acceleration * t**2 / 2, self.length - self.acceleration * remainder**2 / 2
        return np.where(t < self.ramp, rising, np.where(remainder < self.ramp, falling, cruise))

    def time(self, distance: np.ndarray) -> np.ndarray:
        """Return the time since the start [s] at which distances [mm], shape (n,), are reached; clamped."""
        s = np.clip(np.asarray(distance, dtype=float), 0.0, self.length)
        if not self.length:
            return np.zeros_like(s)
        edge = self.acceleration * self.ramp**2 / 2
        rising = np.sqrt(2 * s / self.acceleration)
        falling = self.duration - np.sqrt(2 * (self.length - s) / self.acceleration)
        cruise = s / self.peak + self.ramp / 2
        return np.where(s < edge, rising, np.where(s > self.length - edge, falling, cruise))

    def progress(self, position: np.ndarray) -> np.ndarray:
        """Return how far along the move [mm], shape (n,), positions [mm], shape (n, 3), lie."""
        return (position - self.start) @ (self.target - self.start) / self.length

    def knots(self) -> tuple[np.ndarray, np.ndarray]:
        """Return a polyline: times since the start [s], shape (k,), and positions [mm], shape (k, 3)."""
        # Only the ramps are curved; the stretch between them is linear and needs no knots.
        ramp = np.linspace(0.0, self.ramp, KNOTS_PER_RAMP + 1)
        time = np.unique(np.concatenate([ramp, self.duration - ramp]))
        share = self.distance(time) / self.length if self.length else np.zeros_like(time)
        return time, self.start + share[:, None] * (self.target - self.start)


@dataclass(frozen=True)
class AxisLimits:
    """Acceleration and speed limits of the controller's axes."""

    acceleration: np.ndarray
    """Acceleration limit of each axis [mm/s^2], shape (3,)."""
    max_rate: np.ndarray
    """Speed limit of each axis [mm/s], shape (3,)."""

    def straight_move(self, start: np.ndarray, target: np.ndarray, speed: float) -> Trapezoid:
        """Return the controller's move from ``start`` to ``target`` [mm] at ``speed`` [mm/s]."""
        start, target = np.asarray(start, dtype=float), np.asarray(target, dtype=float)
        length = np.linalg.norm(target - start)
        if not length:
            return Trapezoid(start, target, speed, float(self.acceleration.min()))
        share = np.abs(target - start) / length
        moving = share > 0
        # Grbl plans along the line: each axis limits it by the axis's share of the direction.
        rate = float((self.max_rate[moving] / share[moving]).min())
        acceleration = float((self.acceleration[moving] / share[moving]).min())
        return Trapezoid(start, target, min(speed, rate), acceleration)
