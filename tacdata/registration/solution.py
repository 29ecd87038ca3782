"""Turns touches and centres into a registration: a plane through the heights, a rigid motion through the taxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Plane:
    """Height of first contact over the guide's x and y: z = c + a (x - x0) + b (y - y0)."""

    center: tuple[float, float]
    """Reference point x0 and y0 [mm, machine]."""
    height: float
    """c [mm]."""
    slope: tuple[float, float]
    """a and b [mm/mm]."""
    covariance: np.ndarray
    """Covariance of c, a and b [mm^2, mm, 1], shape (3, 3)."""
    residual: np.ndarray
    """Measured minus fitted heights [mm], shape (n,)."""

    def at(self, x: float, y: float) -> float:
        """Return the height [mm] at a place [mm, machine]."""
        return self.height + self.slope[0] * (x - self.center[0]) + self.slope[1] * (y - self.center[1])

    def uncertainty_at(self, x: float, y: float) -> float:
        """Return the standard uncertainty [mm] of `at`."""
        row = np.array([1.0, x - self.center[0], y - self.center[1]])
        return float(np.sqrt(row @ self.covariance @ row))


def fit_plane(place: np.ndarray, height: np.ndarray, uncertainty: np.ndarray) -> Plane:
    """Fit a plane by weighted least squares.

    Its covariance is inflated where the heights scatter more than their uncertainties.

    Args:
        place: x and y [mm, machine], shape (n, 2); three or more, not on a line.
        height: Heights of first contact [mm], shape (n,).
        uncertainty: Standard uncertainty of each [mm], shape (n,).
    """
    center = place.mean(axis=0)
    # About their centre the errors of height and slope are nearly independent.
    design = np.column_stack([np.ones(len(place)), place - center])
    weighted = design / uncertainty[:, None]
    solution = np.linalg.lstsq(weighted, height / uncertainty, rcond=None)[0]
    residual = height - design @ solution
    degrees = max(len(place) - 3, 1)
    scale = max(float(((residual / uncertainty) ** 2).sum()) / degrees, 1.0)
    covariance = np.linalg.inv(weighted.T @ weighted) * scale
    x0, y0 = center.tolist()
    return Plane((x0, y0), float(solution[0]), (float(solution[1]), float(solution[2])), covariance, residual)


@dataclass(frozen=True)
class RigidMotion:
    """A rigid motion in the plane: machine = shift + R_z(yaw) sensor."""

    shift: tuple[float, float]
    """Machine position of the sensor's origin [mm]."""
    yaw: float
    """Rotation [deg]."""
    shift_uncertainty: tuple[float, float]
    """Standard uncertainty of `shift` [mm]."""
    yaw_uncertainty: float
    """Standard uncertainty of `yaw` [deg]."""
    scale: float
    """Measured over expected distances between the taxels [1]; 1 if guide and sensor file agree."""
    residual: np.ndarray
    """Distance of each taxel's centre from where the motion puts it [mm], shape (n,)."""


def fit_rigid_motion(sensor: np.ndarray, machine: np.ndarray, uncertainty: np.ndarray) -> RigidMotion:
    """Fit shift and rotation (Umeyama, IEEE PAMI 13, 1991, eqs. 34 to 43, in two dimensions, without scale).

    Args:
        sensor: Taxel centres [mm, sensor frame], shape (n, 2); two or more.
        machine: Where they were found [mm, machine], shape (n, 2).
        uncertainty: Standard uncertainty of each coordinate found [mm], shape (n, 2).
    """
    a, b = sensor - sensor.mean(axis=0), machine - machine.mean(axis=0)
    # In two dimensions the best rotation is the angle of the vector (dot, cross).
    dot = float((a * b).sum())
    cross = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    yaw = np.arctan2(cross, dot)
    rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    shift = machine.mean(axis=0) - rotation @ sensor.mean(axis=0)
    residual = np.linalg.norm(machine - shift - sensor @ rotation.T, axis=1)
    lever = float((a**2).sum())
    degrees = max(2 * len(sensor) - 3, 1)
    # The larger of stated and observed scatter: three taxels may agree by chance.
    spread = max(float(np.sqrt((uncertainty**2).mean())), float(np.sqrt((residual**2).sum() / degrees)))
    turning = spread / np.sqrt(lever)
    # The origin is off the taxels' mean, so an error of the yaw moves it by that distance.
    arm = float(np.linalg.norm(sensor.mean(axis=0)))
    position = float(np.sqrt(spread**2 / len(sensor) + (turning * arm) ** 2))
    scale = float(np.hypot(dot, cross)) / lever
    x, y = shift.tolist()
    return RigidMotion(
        (x, y), float(np.degrees(yaw)), (position, position), float(np.degrees(turning)), scale, residual
    )
