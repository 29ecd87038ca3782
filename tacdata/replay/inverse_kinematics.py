"""Joint values that bring a robot's fingertips to their targets, by mink on MuJoCo's kinematics (decision 0011).

Each time is solved from the one before, and the resulting fingertip positions are checked. Where they miss their
targets, other starts are tried: the last success, the home position, some at random. Targets out of reach are named,
and their joint values are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.replay.kinematic_search import OTHERS, STEPS, KinematicSearch
from tacdata.replay.kinematics import Joint, Kinematics
from tacdata.replay.robot import Robot
from tacdata.replay.targets import FingertipTargets

COUPLED = 1e-4
"""Largest deviation of a mimic joint from its joint [rad or m]; beyond it no target of that time counts as reached."""
AGAIN = 15
"""While a target is out of reach, other starts are tried at every this many times [count]."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint values, and which targets they miss."""

    joints: tuple[Joint, ...]
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    values: np.ndarray
    """Joint values [rad or m], shape (n, joints); NaN in rows where a target is not reached."""
    position_error: np.ndarray
    """Distance of each fingertip from its target, at the best solution [m], shape (n, f)."""
    rotation_error: np.ndarray
    """Angle between each fingertip and its target [rad], shape (n, f)."""
    unreached: dict[str, tuple[int, ...]]
    """Finger -> rows whose target is missed by more than the tolerance."""
    outside_workspace: dict[str, tuple[int, ...]]
    """Finger -> rows whose target lies outside the robot's workspace."""
    too_fast: dict[str, tuple[int, ...]]
    """Joint -> rows that need more speed than the joint's limit."""


def follow(robot: Robot, targets: FingertipTargets) -> tuple[JointPath, Kinematics]:
    """Return the joint path that follows the targets; everything that cannot be followed is named.

    Raises:
        UsageError: If the robot has no fingertip for a finger.
        FormatError: If its URDF cannot be used.
    """
    from scipy.spatial.transform import Rotation

    model = Kinematics(robot, targets.fingers)
    inverse = np.linalg.inv(robot.base)
    places = targets.position @ inverse[:3, :3].T + inverse[:3, 3]
    turns = inverse[:3, :3] @ Rotation.from_quat(targets.quaternion.reshape(-1, 4)).as_matrix()
    turns = turns.reshape(*places.shape[:2], 3, 3)
    values, errors, angles = _search(model, places, turns)
    far = np.asarray(errors > robot.tolerance[0])
    if robot.tolerance[1] is not None:
        far |= angles > robot.tolerance[1]
    outside = np.zeros_like(far)
    if robot.workspace is not None:
        outside = np.any((places < robot.workspace[0]) | (places > robot.workspace[1]), axis=-1)
    values[(far | outside).any(axis=1)] = np.nan
    return JointPath(
        model.joints, targets.time_ns, values, errors, angles, _rows(far, targets.fingers),
        _rows(outside, targets.fingers), _too_fast(model.joints, values, targets.time_ns),
    ), model  # fmt: skip


def _search(model: Kinematics, places: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return joint values, shape (n, joints), and the errors of each target: [m] and [rad], shape (n, f)."""
    search, count = KinematicSearch(model), len(places)
    values, errors = np.empty((count, len(model.joints))), np.empty(places.shape[:2])
    angles = np.empty_like(errors)
    start, good, missed = model.home, model.home, 0
    for row, (place, turn) in enumerate(zip(places, turns, strict=True)):
        search.aim(place, turn)
        start, cost = search.settle(start, STEPS if row else 10 * STEPS)
        if not _reached(search, start) and missed % AGAIN == 0:
            rng = np.random.default_rng(row)
            for begin in (good, model.home, *(search.drawn(rng) for _ in range(OTHERS))):
                other, left = search.settle(begin)
                start, cost = (other, left) if left < cost else (start, cost)
        values[row] = start
        errors[row], angles[row], off = search.errors(start)
        if off > COUPLED:
            errors[row] = np.inf
        good, missed = (start, 0) if _reached(search, start) else (good, missed + 1)
    return values, errors, angles


def _reached(search: KinematicSearch, values: np.ndarray) -> bool:
    place, angle = search.model.robot.tolerance
    far, turned, off = search.errors(values)
    return bool((far <= place).all() and off <= COUPLED and (angle is None or (turned <= angle).all()))


def _rows(found: np.ndarray, fingers: tuple[str, ...]) -> dict[str, tuple[int, ...]]:
    named = {name: tuple(np.flatnonzero(found[:, k]).tolist()) for k, name in enumerate(fingers)}
    return {name: rows for name, rows in named.items() if rows}


def _too_fast(joints: tuple[Joint, ...], values: np.ndarray, time_ns: np.ndarray) -> dict[str, tuple[int, ...]]:
    speed = np.abs(np.diff(values, axis=0)) / (np.diff(time_ns) * 1e-9)[:, None]
    found = {
        joint.name: tuple((1 + np.flatnonzero(speed[:, k] > joint.velocity * (1 + 1e-6))).tolist())
        for k, joint in enumerate(joints) if joint.velocity is not None
    }  # fmt: skip
    return {name: rows for name, rows in found.items() if rows}
