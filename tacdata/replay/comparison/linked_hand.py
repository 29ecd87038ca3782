"""A hand with links in place of free pads: its joints follow the path of the `joints` exporter.

Each joint is held at its command by a spring as stiff as the robot file states, within its limits and the URDF's
effort. Pads are ellipsoids on the links, turned as the links are. Links have no weight, as controllers make up for it,
and no shapes but the pads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.errors import UsageError
from tacdata.replay.engine import mujoco
from tacdata.replay.grasp import touched
from tacdata.replay.inverse_kinematics import follow
from tacdata.replay.robot import Robot
from tacdata.replay.scene import ReplayScene
from tacdata.replay.scene_model import PAD, add_actuator, add_pad, interpolated
from tacdata.replay.targets import FingertipTargets

FASTEST = 200.0
"""Largest natural frequency of a joint [rad/s]; the inertia of its motor makes it so. Grasps are a hundredth of it."""
LINK_MASS, LINK_INERTIA = 0.02, 1e-6
"""Of each link [kg, kg m^2]."""
PREFIX = "robot "
"""Of links, joints and pads in the scene's model: a URDF may have a link "object"."""
DAMPED = 1e-3
"""Damping of the inverse of the Jacobian, over its largest singular value [1]: no joint runs off near a singularity."""


class LinkedHand:
    """A robot whose joints follow one path; a `PadDrive` of `tacdata.replay.scene_model`."""

    def __init__(self, robot: Robot, targets: FingertipTargets, scene: ReplayScene) -> None:
        """Solve the path.

        Args:
            robot: With a stiffness for each joint that follows no other.
            targets: Where its fingertips go.
            scene: The undisturbed scene: joints vary with its stiffness, by the same share.

        Raises:
            UsageError: If the robot cannot follow all of the path, or a stiffness is missing.
        """
        path, kinematics = follow(robot, targets)
        self._robot, self._fingers, self._usual = robot, targets.fingers, scene.stiffness
        lost = int((~np.isfinite(path.values).all(axis=1)).sum())
        if lost:
            raise UsageError(
                f"robot {robot.name} does not follow {lost} of {len(path.values)} targets",
                "a path that it follows all the way",
                "see why with tacdata export --format joints, and move its base or widen its tolerance",
            )
        names = tuple(joint.name for joint in path.joints)
        self._driven = [k for k, name in enumerate(names) if name not in path.mimics]
        self._names, self._values = names, path.values
        missing = [names[k] for k in self._driven if names[k] not in robot.stiffness]
        if missing:
            raise UsageError(
                f"robot {robot.name} states no stiffness of {', '.join(missing)}",
                "a stiffness for each joint that follows no other [N m/rad or N/m]",
                "add it to the robot file under stiffness",
            )
        self._coupling = _coupling(kinematics.model, len(names))[:, self._driven]
        touch = touched(targets)[0].min(axis=1).argmax()
        self.stiffness = self._stiffness_along(kinematics, path.values[touch], targets.normals[touch])

    def _stiffness_along(self, kinematics: Any, values: np.ndarray, outward: np.ndarray) -> float:
        """Return the mean stiffness of fingertips along their normals [N/m] in a posture."""
        engine, model = mujoco(), kinematics.model
        data = engine.MjData(model)
        data.qpos[:] = values
        engine.mj_kinematics(model, data)
        engine.mj_comPos(model, data)
        compliance, jacobian = [], np.zeros((3, model.nv))
        give = np.array([1 / self._robot.stiffness[self._names[k]] for k in self._driven])
        for name, normal in zip(self._fingers, outward @ self._robot.base[:3, :3], strict=True):
            engine.mj_jacSite(model, data, jacobian, None, model.site(f"tip {name}").id)
            lever = normal @ jacobian @ self._coupling
            compliance.append(float(lever**2 @ give))
        return 1 / float(np.mean(compliance))

    def mount(self, spec: Any, scene: ReplayScene) -> None:
        """Add links, pads and actuators."""
        engine, robot = mujoco(), self._robot
        links = engine.MjSpec.from_string(robot.urdf)
        links.compiler.fusestatic = False
        links.compiler.boundmass, links.compiler.boundinertia = LINK_MASS, LINK_INERTIA
        for k, name in enumerate(self._fingers):
            link, pose = robot.tips[name]
            sizes = robot.pads.get(name, (PAD, PAD, PAD))
            # The fingertip's origin is on the pad, where its normal leaves it.
            centre = pose[:3, 3] - sizes[2] * pose[:3, 2]
            add_pad(links.body(link) or links.worldbody, k, scene, sizes, pos=centre, quat=_quaternion(pose))
        place = robot.base[:3, 3].tolist()
        spec.attach(links, frame=spec.worldbody.add_frame(pos=place, quat=_quaternion(robot.base)), prefix=PREFIX)
        for body in spec.bodies:
            body.gravcomp = 0.0 if body.name in ("world", "object") else 1.0
        for k in self._driven:
            stiffness = robot.stiffness[self._names[k]] * scene.stiffness / self._usual
            joint = spec.joint(PREFIX + self._names[k])
            # Without weight of its own a stiff joint would need shorter time steps.
            joint.armature = stiffness / FASTEST**2
            add_actuator(spec, joint.name, stiffness, 2 * stiffness / FASTEST)
        self._bias = np.array(scene.bias) if scene.bias else np.zeros((len(self._fingers), 3))

    def begin(self, model: Any, data: Any) -> None:
        """Bring the joints to the beginning of the path."""
        self._model, self._data = model, data
        joints = [model.joint(PREFIX + name) for name in self._names]
        data.qpos[[int(joint.qposadr[0]) for joint in joints]] = self._values[0]
        self._columns = [int(joint.dofadr[0]) for joint in joints]
        self._pads = [model.geom(f"{PREFIX}tip{k}").id for k in range(len(self._fingers))]
        mujoco().mj_forward(model, data)

    def commands(self, pads: np.ndarray, seconds: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Return the path of the driven joints at moments [s], shape (m, actuators)."""
        return interpolated(self._values[:, self._driven], seconds, moments)

    def moved(self, displacement: np.ndarray) -> np.ndarray:
        """Return the change of the joints that moves the pads, by the Jacobian of the present posture."""
        away = (displacement + self._bias).ravel()
        if not away.any():
            return np.zeros(len(self._driven))
        engine, model, data = mujoco(), self._model, self._data
        jacobian = np.zeros((len(self._pads), 3, model.nv))
        for k, pad in enumerate(self._pads):
            engine.mj_jacGeom(model, data, jacobian[k], None, pad)
        whole = jacobian.reshape(-1, model.nv)[:, self._columns] @ self._coupling
        square = whole @ whole.T
        # Damped least squares.
        square += (DAMPED**2 * np.trace(square)) * np.eye(len(square))
        return whole.T @ np.linalg.solve(square, away)


def _coupling(model: Any, count: int) -> np.ndarray:
    """Return the change of each joint with each other, shape (count, count): mimic joints follow, the others move."""
    rows = np.eye(count)
    for k in range(model.neq):
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        rows[follower] = model.eq_data[k, 1] * rows[leader]
    return rows


def _quaternion(pose: np.ndarray) -> np.ndarray:
    """Return the rotation of a pose as MuJoCo writes it: the real part first."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    return np.array([w, x, y, z])
