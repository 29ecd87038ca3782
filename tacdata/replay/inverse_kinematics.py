"""Joint values that bring a robot's fingertips to their targets, by mink on MuJoCo's kinematics (decision 0011).

Each time is solved from the one before, by damped steps within the joints' limits until the fingertips rest; then it is
measured where they are. What does not reach its target is said, and its joint values are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.replay.engine import mujoco
from tacdata.replay.robot import Robot
from tacdata.replay.targets import Targets

STEPS = 60
"""Largest number of steps at one time [count]; the first time gets ten times as many."""
REST = 1e-7
"""A step that moves no joint by more has come to rest [rad or m]."""
DAMPING = 1e-6
"""Levenberg and Marquardt's damping [1]."""
COUPLED = 1e-4
"""How far a mimic joint may be off the joint that it follows [rad or m]; beyond, no target of that time is reached."""
SOLVER = "daqp"


@dataclass(frozen=True)
class Joint:
    """A joint that moves."""

    name: str
    unit: str
    """"rad" or "m"."""
    lower: float | None
    """Lower limit [rad or m]."""
    upper: float | None
    """Upper limit [rad or m]."""
    velocity: float | None
    """Largest speed [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class JointPath:
    """What the joints do, and what cannot be done."""

    joints: tuple[Joint, ...]
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    values: np.ndarray
    """Joint values [rad or m], shape (n, joints); NaN in rows where a target is not reached."""
    position_error: np.ndarray
    """Distance of each fingertip from its target, at the best that was found [m], shape (n, f)."""
    rotation_error: np.ndarray
    """Angle between each fingertip and its target [rad], shape (n, f)."""
    unreached: dict[str, tuple[int, ...]]
    """Finger -> rows whose target lies further than the tolerance from where the fingertip can be."""
    outside_workspace: dict[str, tuple[int, ...]]
    """Finger -> rows whose target lies outside the robot's workspace."""
    too_fast: dict[str, tuple[int, ...]]
    """Joint -> rows that are reached only faster than the joint's limit."""


class Kinematics:
    """A robot's fingertips as functions of its joints, in the demonstration's frame."""

    def __init__(self, robot: Robot, fingers: tuple[str, ...]) -> None:
        """Build the model.

        Raises:
            UsageError: If the robot has no fingertip for a finger.
            FormatError: If MuJoCo cannot make a model of the URDF.
        """
        engine = mujoco()
        missing = [name for name in fingers if name not in robot.tips]
        if missing:
            raise UsageError(
                f"robot {robot.name} has no fingertip for {', '.join(missing)}", ", ".join(robot.tips),
                "add it to the robot file, or export other fingers with --finger",
            )  # fmt: skip
        self.robot, self.fingers = robot, fingers
        try:
            spec = engine.MjSpec.from_string(robot.urdf)
            spec.compiler.fusestatic = False
            # Kinematics needs no masses, MuJoCo does.
            spec.compiler.boundmass, spec.compiler.boundinertia = 1e-3, 1e-6
            for name in fingers:
                self._add_site(spec, name)
            self.model = spec.compile()
        except (ValueError, RuntimeError, AttributeError) as error:
            reason = str(error).strip().splitlines()[0]
            raise FormatError(f"the URDF of {robot.name}: {reason}", "a URDF that MuJoCo reads", "correct it") from None
        self.joints = tuple(self._joint(k) for k in range(self.model.njnt))

    def _add_site(self, spec: Any, name: str) -> None:
        from scipy.spatial.transform import Rotation

        link, pose = self.robot.tips[name]
        body = spec.body(link) or spec.worldbody  # MuJoCo makes the root link the world
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        body.add_site(name=f"tip {name}", pos=pose[:3, 3], quat=[w, x, y, z])

    def _joint(self, k: int) -> Joint:
        engine = mujoco()
        name, kind = self.model.joint(k).name, int(self.model.jnt_type[k])
        if kind not in (engine.mjtJoint.mjJNT_HINGE, engine.mjtJoint.mjJNT_SLIDE):
            raise FormatError(f"joint {name} of {self.robot.name} floats", "joints of one axis", "fix the robot's base")
        low, high = self.model.jnt_range[k] if self.model.jnt_limited[k] else (None, None)
        unit = "rad" if kind == engine.mjtJoint.mjJNT_HINGE else "m"
        ends = (None if low is None else float(low), None if high is None else float(high))
        return Joint(name, unit, *ends, self.robot.velocity.get(name))

    @property
    def home(self) -> np.ndarray:
        """Where the search begins [rad or m], shape (joints,)."""
        middles = [0.0 if j.lower is None or j.upper is None else (j.lower + j.upper) / 2 for j in self.joints]
        return np.array([self.robot.home.get(j.name, m) for j, m in zip(self.joints, middles, strict=True)])

    def tips(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return fingertips of joint values, shape (joints,): places [m], shape (f, 3), rotations, shape (f, 3, 3)."""
        engine = mujoco()
        data = engine.MjData(self.model)
        data.qpos[:] = values
        engine.mj_kinematics(self.model, data)
        sites = [data.site(f"tip {name}") for name in self.fingers]
        base = self.robot.base
        places = np.array([base[:3, :3] @ site.xpos + base[:3, 3] for site in sites])
        return places, np.array([base[:3, :3] @ site.xmat.reshape(3, 3) for site in sites])


def follow(robot: Robot, targets: Targets) -> tuple[JointPath, Kinematics]:
    """Return the joint path that follows the targets, with everything that cannot be followed named.

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
    """Return joint values, shape (n, joints), and what is left of each target: [m] and [rad], shape (n, f)."""
    import mink

    weight = model.robot.orientation_weight
    tasks = [
        mink.FrameTask(f"tip {name}", "site", position_cost=1.0, orientation_cost=weight, lm_damping=DAMPING)
        for name in model.fingers
    ]
    coupled = mink.EqualityConstraintTask(model.model, cost=10.0) if model.model.neq else None  # mimic joints
    wanted = [*tasks, *([coupled] if coupled else [])]
    state, limits = mink.Configuration(model.model, q=model.home), [mink.ConfigurationLimit(model.model)]
    values = np.empty((len(places), len(model.joints)))
    errors, angles = np.empty(places.shape[:2]), np.empty(places.shape[:2])
    for row, (place, turn) in enumerate(zip(places, turns, strict=True)):
        for task, p, r in zip(tasks, place, turn, strict=True):
            task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(r), p))
        for _ in range(STEPS if row else 10 * STEPS):
            step = mink.solve_ik(state, wanted, 1.0, SOLVER, limits=limits)
            state.integrate_inplace(step, 1.0)
            if np.abs(step).max() < REST:
                break
        values[row] = state.q
        for k, task in enumerate(tasks):
            left = task.compute_error(state)
            errors[row, k], angles[row, k] = np.linalg.norm(left[:3]), np.linalg.norm(left[3:])
        if coupled is not None and np.abs(coupled.compute_error(state)).max() > COUPLED:
            errors[row] = np.inf
    return values, errors, angles


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
