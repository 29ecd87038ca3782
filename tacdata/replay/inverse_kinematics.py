"""Joint values that bring a robot's fingertips to their targets, by mink on MuJoCo's kinematics (decision 0011).

Each time is solved from the one before, and the resulting fingertip positions are checked. Where they miss their
targets, other starts are tried: the last success, the home position, some at random. Where that path jumps, postures
are chosen along the whole of it (`tacdata.replay.posture_path`). Targets out of reach are named, and their joint values
are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from tacdata.replay.kinematic_search import OTHERS, STEPS, KinematicSearch
from tacdata.replay.kinematics import Joint, Kinematics
from tacdata.replay.posture_path import without_jumps
from tacdata.replay.robot import Robot
from tacdata.replay.self_collision import SelfCollisions, self_collisions
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
    """Finger -> rows whose target is outside the robot's workspace."""
    too_fast: dict[str, tuple[int, ...]]
    """Joint -> rows that need more speed than the joint's limit."""
    too_abrupt: dict[str, tuple[int, ...]]
    """Joint -> rows that need more acceleration than the joint's limit."""
    mimics: tuple[str, ...]
    """Joints that follow others by the URDF."""
    uncoupled: tuple[int, ...]
    """Rows whose targets no coupled (mimic) joints reach together."""
    other_posture: tuple[int, ...]
    """Rows that are reached only in a posture that the joints cannot take up in time."""
    collisions: SelfCollisions
    """Links that touch each other."""


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
    search = KinematicSearch(model)
    values, errors, angles, coupling_error = _search(search, places, turns)
    far = np.asarray(errors > robot.tolerance[0])
    if robot.tolerance[1] is not None:
        far |= angles > robot.tolerance[1]
    uncoupled = coupling_error > COUPLED
    reached = ~far.any(axis=1) & ~uncoupled
    values, served = without_jumps(
        search,
        lambda row: search.aim(places[row], turns[row]),
        partial(_reached, search),
        values,
        reached,
        targets.time_ns,
    )
    # The chosen postures differ from the first solution, so their errors are computed again.
    for row in np.flatnonzero(served):
        search.aim(places[row], turns[row])
        errors[row], angles[row], _ = search.errors(values[row])
    far[served], uncoupled[served] = False, False
    outside = np.zeros_like(far)
    if robot.workspace is not None:
        outside = np.any((places < robot.workspace[0]) | (places > robot.workspace[1]), axis=-1)
    values[outside.any(axis=1)] = np.nan
    names = tuple(joint.name for joint in model.joints)
    touching = SelfCollisions({}, "the robot has no URDF file")
    if robot.source is not None:
        touching = self_collisions(robot.source, names, values, model.home)
    return JointPath(
        model.joints,
        targets.time_ns,
        values,
        errors,
        angles,
        _rows(far, targets.fingers),
        _rows(outside, targets.fingers),
        *_limits(model.joints, values, targets.time_ns),
        model.mimics,
        tuple(np.flatnonzero(uncoupled).tolist()),
        tuple(np.flatnonzero(reached & ~served).tolist()),
        touching,
    ), model


def _search(
    search: KinematicSearch, places: np.ndarray, turns: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return joint values, shape (n, joints), the errors of each target, [m] and [rad], shape (n, f), and of couplings.

    The deviation of mimic joints [rad or m] has shape (n,).
    """
    model, count = search.model, len(places)
    values, errors = np.empty((count, len(model.joints))), np.empty(places.shape[:2])
    angles, coupling = np.empty_like(errors), np.zeros(count)
    start, good, missed = model.home, model.home, 0
    for row, (place, turn) in enumerate(zip(places, turns, strict=True)):
        search.aim(place, turn)
        # From the row before, so that the path keeps its posture where it can.
        start, cost = search.settle(start, STEPS if row else 10 * STEPS)
        if not _reached(search, start) and missed % AGAIN == 0:
            # Seeded by the row: the same targets give the same path, whatever part of them is solved.
            rng = np.random.default_rng(row)
            for begin in (good, model.home, *(search.drawn(rng) for _ in range(OTHERS))):
                candidate, candidate_cost = search.settle(begin)
                start, cost = (candidate, candidate_cost) if candidate_cost < cost else (start, cost)
        values[row] = start
        errors[row], angles[row], coupling[row] = search.errors(start)
        good, missed = (start, 0) if _reached(search, start) else (good, missed + 1)
    return values, errors, angles, coupling


def _reached(search: KinematicSearch, values: np.ndarray) -> bool:
    place, angle = search.model.robot.tolerance
    far, rotation, coupling_error = search.errors(values)
    return bool((far <= place).all() and coupling_error <= COUPLED and (angle is None or (rotation <= angle).all()))


def _rows(mask: np.ndarray, fingers: tuple[str, ...]) -> dict[str, tuple[int, ...]]:
    named = {name: tuple(np.flatnonzero(mask[:, k]).tolist()) for k, name in enumerate(fingers)}
    return {name: rows for name, rows in named.items() if rows}


def rates(values: np.ndarray, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return speeds, shape (n - 1, joints), and accelerations, shape (n - 2, joints), by differences [per s, s^2].

    Args:
        values: Joint values [rad or m], shape (n, joints).
        time_ns: Times [ns], shape (n,).
    """
    step = (np.diff(time_ns) * 1e-9)[:, None]
    speed = np.diff(values, axis=0) / step
    return speed, np.diff(speed, axis=0) / ((step[1:] + step[:-1]) / 2)


def _limits(
    joints: tuple[Joint, ...], values: np.ndarray, time_ns: np.ndarray
) -> tuple[dict[str, tuple[int, ...]], dict[str, tuple[int, ...]]]:
    """Return the rows that need more speed, and those that need more acceleration, than each joint has."""
    speed, acceleration = rates(values, time_ns)
    fast, abrupt = {}, {}
    for k, joint in enumerate(joints):
        if joint.velocity is not None:
            # Rounding must not report a joint that runs at its limit.
            excess = np.abs(speed[:, k]) > joint.velocity * (1 + 1e-6)
            fast[joint.name] = tuple((1 + np.flatnonzero(excess)).tolist())
        if joint.acceleration is not None:
            excess = np.abs(acceleration[:, k]) > joint.acceleration * (1 + 1e-6)
            abrupt[joint.name] = tuple((1 + np.flatnonzero(excess)).tolist())
    return {name: rows for name, rows in fast.items() if rows}, {name: rows for name, rows in abrupt.items() if rows}
