"""A robot's fingertips as functions of its joints, on MuJoCo's kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.replay.engine import mujoco
from tacdata.replay.robot import Robot


@dataclass(frozen=True)
class Joint:
    """A movable joint."""

    name: str
    unit: str
    """"rad" or "m"."""
    lower: float | None
    """Lower limit [rad or m]."""
    upper: float | None
    """Upper limit [rad or m]."""
    velocity: float | None
    """Largest speed [rad/s or m/s]."""
    acceleration: float | None = None
    """Largest acceleration [rad/s^2 or m/s^2]."""


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
                f"robot {robot.name} has no fingertip for {', '.join(missing)}",
                ", ".join(robot.tips),
                "add it to the robot file, or export other fingers with --finger",
            )
        self.robot, self.fingers = robot, fingers
        try:
            spec = engine.MjSpec.from_string(robot.urdf)
            # Links on fixed joints would be merged and lose their names, and a fingertip may hang on one.
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
        if not self.moving:
            fault = f"robot {robot.name}: no joint moves the fingertip of {', '.join(fingers)}"
            raise FormatError(fault, "a link that joints move", "name another link in the robot file")
        for joint, value in zip(self.joints, self.home, strict=True):
            if (joint.lower is not None and value < joint.lower) or (joint.upper is not None and value > joint.upper):
                fault = f"home of joint {joint.name} of {robot.name}: {value:g} {joint.unit}"
                raise FormatError(fault, f"{joint.lower:g} to {joint.upper:g} {joint.unit}", "correct the robot file")

    def _add_site(self, spec: Any, name: str) -> None:
        from scipy.spatial.transform import Rotation

        link, pose = self.robot.tips[name]
        body = spec.body(link) or spec.worldbody  # MuJoCo makes the root link the world
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        # MuJoCo writes the real part of a quaternion first.
        body.add_site(name=f"tip {name}", pos=pose[:3, 3], quat=[w, x, y, z])

    def _joint(self, k: int) -> Joint:
        engine = mujoco()
        name, kind = self.model.joint(k).name, int(self.model.jnt_type[k])
        if kind not in (engine.mjtJoint.mjJNT_HINGE, engine.mjtJoint.mjJNT_SLIDE):
            raise FormatError(f"joint {name} of {self.robot.name} floats", "joints of one axis", "fix the robot's base")
        low, high = self.model.jnt_range[k] if self.model.jnt_limited[k] else (None, None)
        unit = "rad" if kind == engine.mjtJoint.mjJNT_HINGE else "m"
        ends = (None if low is None else float(low), None if high is None else float(high))
        return Joint(name, unit, *ends, self.robot.velocity.get(name), self.robot.acceleration.get(name))

    @property
    def moving(self) -> list[int]:
        """Joints between the root and a fingertip, without mimic joints elsewhere."""
        bodies = set()
        for name in self.fingers:
            body = int(self.model.site(f"tip {name}").bodyid[0])
            while body:
                bodies.add(body)
                body = int(self.model.body_parentid[body])
        return [k for k in range(self.model.njnt) if int(self.model.jnt_bodyid[k]) in bodies]

    @property
    def mimics(self) -> tuple[str, ...]:
        """Names of the joints that follow others by the URDF."""
        return tuple(self.model.joint(int(k)).name for k in self.model.eq_obj1id[: self.model.neq])

    @property
    def home(self) -> np.ndarray:
        """Start of the search [rad or m], shape (joints,)."""
        middles = [0.0 if j.lower is None or j.upper is None else (j.lower + j.upper) / 2 for j in self.joints]
        return np.array([self.robot.home.get(j.name, m) for j, m in zip(self.joints, middles, strict=True)])

    def tips(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the fingertips for joint values, shape (joints,): positions [m], shape (f, 3), rotations, shape (f, 3,
        3).
        """
        engine = mujoco()
        data = engine.MjData(self.model)
        data.qpos[:] = values
        engine.mj_kinematics(self.model, data)
        sites = [data.site(f"tip {name}") for name in self.fingers]
        base = self.robot.base
        places = np.array([base[:3, :3] @ site.xpos + base[:3, 3] for site in sites])
        return places, np.array([base[:3, :3] @ site.xmat.reshape(3, 3) for site in sites])
