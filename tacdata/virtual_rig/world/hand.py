"""An emulated hand that grasps a ball, a can or a box, or wipes with an eraser, again and again.

World: z up; the object is on the table about the origin. Fingertip frame: origin on the pad, x along the finger, z
out of the pad. The object presses the skins with the ball's radius, or by round nubs of a smaller one.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

RADIUS = 35.0
"""Radius of the ball [mm]."""
HEIGHT = 36.0
"""Height of the place that is grasped over the table [mm]."""
THINGS = {"ball": RADIUS, "can": 33.0, "box": 30.0, "eraser": 25.0}
"""Object -> half its width between the fingers [mm]."""
FLAT = ("box", "eraser")
"""Objects with two parallel faces, of which the thumb presses one and the others the other."""
DIRECTIONS = {"thumb": (-1.0, 0.0, 0.05), "index": (0.93, 0.36, 0.05), "middle": (0.93, -0.36, 0.05)}
"""From the object's centre to each finger of a right hand."""
TIMES = (0.8, 2.0, 2.5, 3.7, 5.7, 6.9, 7.2, 8.2)
"""End times of: waiting, closing, pressing, lifting, holding, lowering, letting go, opening [s]; then it repeats."""
PERIOD = 8.5
"""From one grasp to the next [s]."""
REACH = 45.0
"""Distance of the fingertips from the ball before and after [mm]."""
LIFT = 90.0
"""Height of the lift [mm]."""
TASKS = ("grasp", "wipe")
ERASER_HEIGHT = 15.0
"""Height of the eraser's middle [mm]."""
ASIDE = {"thumb": 0.0, "index": 14.0, "middle": -14.0}
"""Position along a flat face that each finger presses [mm]."""
STROKE, STROKES = 40.0, 2
"""Amplitude of wiping to each side [mm], and number of strokes."""


@dataclass(frozen=True)
class Hand:
    """A grasp, drawn from a seed."""

    seed: int
    depth: dict[str, float]
    """Depth of each finger's contact while holding [mm]."""
    skew: dict[str, tuple[float, float]]
    """Position of each finger's contact on the pad: x and y [mm]."""
    tremor: float
    """Amplitude of the hand's tremor at 8 Hz [mm]."""
    task: str = "grasp"
    """"grasp" or "wipe"."""
    nub: float = RADIUS
    """Radius of the nub that presses each skin [mm]: the ball's own, or that of nubs on the object."""
    thing: str = "ball"
    """One of `THINGS`."""

    @property
    def document(self) -> dict[str, Any]:
        """The hand as plain data."""
        values = asdict(self)
        values["skew"] = {name: list(place) for name, place in self.skew.items()}
        return values

    def press(self, finger: str, seconds: float) -> tuple[float, float, float]:
        """Return the contact's x and y on the pad and its depth [mm], at a time [s]."""
        t = seconds % PERIOD
        share = _blend(t, TIMES[1], TIMES[2]) - _blend(t, TIMES[5], TIMES[6])
        return (*self.skew[finger], self.depth[finger] * share)

    def tip(self, finger: str, seconds: float) -> np.ndarray:
        """Return the fingertip's frame in the world, shape (4, 4) [m], at a time [s]."""
        t = seconds % PERIOD
        away = REACH * (1 - _blend(t, TIMES[0], TIMES[1]) + _blend(t, TIMES[6], TIMES[7]))
        outward = self._out(finger)
        normal = -outward
        # Fingers point down, as far as the pad's normal allows.
        axis = np.array([0.0, 0.0, -1.0]) - (-normal[2]) * normal
        axis /= np.linalg.norm(axis)
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([axis, np.cross(normal, axis), normal], axis=-1)
        x, y, depth = self.press(finger, seconds)
        touch = self._middle(finger, t) + outward * (THINGS[self.thing] + away - depth)
        # The pad's origin is the array's centre; the contact is offset from it by the skew.
        place = touch - matrix[:3, 0] * x - matrix[:3, 1] * y
        turn, away_from_rest = self._sway(seconds)
        matrix[:3, :3] = turn @ matrix[:3, :3]
        matrix[:3, 3] = (turn @ place + away_from_rest) / 1000
        return matrix

    def centre(self, seconds: float) -> np.ndarray:
        """Return the place that the fingers grasp or close about, in the world [m], shape (3,), at a time [s]."""
        turn, away_from_rest = self._sway(seconds)
        # The thumb presses the middle of every object.
        return (turn @ self._middle("thumb", seconds % PERIOD) + away_from_rest) / 1000

    def _sway(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Return how the whole hand turns, shape (3, 3), and moves [mm], so that no pose is ever at rest."""
        phase = 2 * np.pi * (seconds + 0.37 * self.seed)
        freedom = 1.0 if self.task == "grasp" else 0.1  # an eraser is flat on its board, and the hand with it
        sway = 4.0 * freedom * np.array([np.sin(phase / 5.1), np.cos(phase / 6.3), 0.3 * np.sin(phase / 4.3)])
        shake = self.tremor * np.array([np.sin(8 * phase), np.sin(8 * phase + 1), np.sin(8 * phase + 2)])
        turn = 0.06 * freedom * np.array([np.sin(phase / 3.7), np.sin(phase / 4.9), np.cos(phase / 6.1)])
        return _turn(turn), sway + shake

    def _out(self, finger: str) -> np.ndarray:
        """Return the direction from the object to a finger [1]."""
        if self.thing in FLAT:
            return np.array([-1.0 if finger == "thumb" else 1.0, 0.0, 0.0])
        direction = np.array(DIRECTIONS[finger])
        if self.thing == "can":
            direction[2] = 0.0  # it is upright
        return direction / np.linalg.norm(direction)

    def _middle(self, finger: str, t: float) -> np.ndarray:
        """Return the point of the object that a finger's normal goes through [mm]."""
        aside = ASIDE[finger] if self.thing in FLAT else 0.0
        if self.task == "wipe":
            stroke = STROKE * np.sin(2 * np.pi * STROKES * _blend(t, TIMES[2], TIMES[5]))
            return np.array([0.0, stroke + aside, ERASER_HEIGHT])
        lift = LIFT * (_blend(t, TIMES[2], TIMES[3]) - _blend(t, TIMES[4], TIMES[5]))
        return np.array([0.0, aside, HEIGHT + lift])


def draw_hand(seed: int, task: str = "grasp", thing: str | None = None) -> Hand:
    """Draw a hand at a task from a seed.

    Args:
        seed: Decides how deep each finger presses, and where.
        task: One of `TASKS`.
        thing: One of `THINGS`; by default the ball or, to wipe, the eraser.
    """
    rng = np.random.default_rng([seed, 11])
    depth = {name: float(rng.uniform(0.7, 1.2)) for name in DIRECTIONS}
    skew = {name: tuple(rng.uniform(-1.0, 1.0, 2).tolist()) for name in DIRECTIONS}
    item = thing or ("eraser" if task == "wipe" else "ball")
    return Hand(seed, depth, skew, float(rng.uniform(0.02, 0.08)), task, thing=item)


def _blend(t: float, begin: float, end: float) -> float:
    """Return a minimum-jerk step: 0 before, 1 after."""
    s = float(np.clip((t - begin) / (end - begin), 0.0, 1.0))
    return s**3 * (10 - 15 * s + 6 * s**2)


def _turn(vector: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()
