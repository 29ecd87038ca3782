"""Errors of the sensor's pose under the guide, and compliance below the tag."""

import numpy as np

from worlds import skin
from worlds.hidden import hidden


@hidden("mounting", "depth offset", most=6, both=True)
def z_offset(w, s):
    """The touch-off was wrong."""
    w.pose[:, 2] += 0.05 * s
    w.tell("z_offset", dz=0.05 * s)


@hidden("mounting", "lateral", most=8, both=True)
def xy_offset(w, s):
    """The sensor is displaced sideways."""
    a = w.rng.uniform(0, 2 * np.pi)
    move = 0.1 * s * np.array([np.cos(a), np.sin(a)])
    w.pose[:, :2] += move
    w.tell("xy_offset", dx=move[0], dy=move[1])


@hidden("mounting", "depth offset", most=6, both=True)
def tilt(w, s):
    """The face is a slope: depth along its normal."""
    a = w.rng.uniform(0, 2 * np.pi)
    slope = 0.012 * s * np.array([np.cos(a), np.sin(a)])
    w.pose[:, 2] = (w.pose[:, 2] + w.pose[:, :2] @ slope) / np.sqrt(1 + slope @ slope)
    w.tell("tilt", a=slope[0], b=slope[1])


@hidden("mounting", "lateral", most=8, both=True)
def rotation(w, s):
    """The sensor is turned: a full rotation matrix."""
    t = 0.03 * s * w.rng.choice([-1, 1])
    w.pose[:, :2] = w.pose[:, :2] @ np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
    w.tell("rotation", theta=t)


@hidden("mounting", "depth offset", most=8, both=True)
def gantry_sag(w, s):
    """The beam hangs through between its ends, as a cosine along x and a little along y."""
    at = np.hypot(w.pose[:, 0], 0.9 * w.pose[:, 1]) / 4.6
    w.pose[:, 2] += 0.06 * s * (1 - np.cos(np.pi / 2 * np.minimum(at, 1.5)))


@hidden("mounting", "depth offset", fitted=True, most=8, both=True)
def thermal_growth(w, s):
    """The column grows hyperbolically in time."""
    w.pose[:, 2] += 0.05 * s * (w.clock / (w.clock + 250.0))


@hidden("mounting", "depth curvature", most=6)
def frame_compliance(w, s):
    """A series spring, solved by bisection."""
    c = 0.12 * s  # mm / N
    z = w.pose[:, 2].copy()
    low, high = z - 2.0, z.copy()
    for _ in range(36):
        middle = 0.5 * (low + high)
        over = middle + c * skin.force(middle, w.radius, w.layer) > z
        high, low = np.where(over, middle, high), np.where(over, low, middle)
    w.pose[:, 2] = 0.5 * (low + high)
