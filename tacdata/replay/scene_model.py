"""The scene in MuJoCo: a support, an object on it, and soft pads on springs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tacdata.replay.engine import mujoco
from tacdata.replay.scene import ReplayScene

STEP = 0.001
"""Time step of the simulation [s]."""
COMMAND = 5
"""Steps between two commands to the fingertips [count]: 200 Hz."""
SETTLE = 0.3
"""Time before the replay in which the object comes to rest [s]."""
PAD = 0.009
"""Radius of a fingertip's pad [m]."""
TIP_MASS = 0.05
"""Mass that moves with a fingertip [kg]."""
TORSION = 0.003
"""Coefficient of torsional friction about a contact's normal [m]: a patch of a few millimetres."""
XML = """
<mujoco>
 <option timestep="{step}" cone="elliptic" integrator="implicitfast" impratio="100"/>
 <worldbody>
  <geom name="table" type="plane" size="1 1 0.1" pos="0 0 {table}" friction="{board} 0.005 0.0001" priority="2"/>
  <body name="object" pos="{x} {y} {z}">
   <freejoint/>
   <geom name="object" type="{kind}" size="{size}" mass="{mass}" condim="4" friction="{friction} {torsion} 0.0001"/>
  </body>
  {tips}
 </worldbody>
 <actuator>{springs}</actuator>
</mujoco>"""
TIP = """<body name="tip{k}" pos="{x} {y} {z}" gravcomp="1">
 <joint name="tip{k}x" type="slide" axis="1 0 0"/><joint name="tip{k}y" type="slide" axis="0 1 0"/>
 <joint name="tip{k}z" type="slide" axis="0 0 1"/>
 <geom name="tip{k}" type="sphere" size="{pad}" mass="{mass}" contype="2" conaffinity="1" condim="4" priority="1"
  friction="{friction} {torsion} 0.0001" solref="-{skin} -{damping}" solimp="{impedance} {impedance} 0.001"/></body>"""
IMPEDANCE = 0.9
"""Impedance of the contact between skin and object [1] (MuJoCo, solver parameters)."""
SPRING = '<position name="{joint}" joint="{joint}" kp="{kp}" kv="{kv}"/>'


Feedback = Callable[[float, np.ndarray, float], np.ndarray]
"""A controller: time [s], depths [m], step [s] -> displacement of the pads [m], shape (f, 3)."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """State of the simulation at the times of the targets."""

    centre: np.ndarray
    """Centre of the object [m], shape (n, 3)."""
    tips: np.ndarray
    """Centres of the pads [m], shape (n, f, 3)."""
    force: np.ndarray
    """Normal force of each pad on the object [N], shape (n, f)."""
    depth: np.ndarray
    """Depth of each pad's skin [m], shape (n, f)."""
    slid: np.ndarray
    """How the object has slid along each pad since they first touched [m], shape (n, f, 3): the sum of its sliding
    velocity over the time of contact, so that to and fro cancel.
    """

    @property
    def slip(self) -> np.ndarray:
        """Distance that it has slid along each pad [m], shape (n, f)."""
        return np.linalg.norm(self.slid, axis=-1)


class SceneModel:
    """The simulation of one trial."""

    def __init__(self, scene: ReplayScene, begin: np.ndarray, centre: np.ndarray) -> None:
        """Build it with the pads' centres at ``begin`` [m], shape (f, 3), and the object's at ``centre`` [m]."""
        engine = mujoco()
        count, critical = len(begin), 2 * np.sqrt(scene.stiffness * TIP_MASS)
        contact = f"{scene.friction:.6g}"
        # MuJoCo's direct solref: a contact at rest gives way by (1 - d) force / (mass rate), with impedance d.
        reduced = TIP_MASS * scene.mass / (TIP_MASS + scene.mass)
        rate = scene.skin * (1 - IMPEDANCE) / reduced
        tips = "".join(
            TIP.format(
                k=k,
                x=place[0],
                y=place[1],
                z=place[2],
                pad=PAD,
                mass=TIP_MASS,
                friction=contact,
                torsion=TORSION,
                skin=rate,
                damping=2 * np.sqrt(rate),
                impedance=IMPEDANCE,
            )
            for k, place in enumerate(begin)
        )
        joints = [f"tip{k}{axis}" for k in range(count) for axis in "xyz"]
        springs = "".join(SPRING.format(joint=joint, kp=scene.stiffness, kv=critical) for joint in joints)
        x, y, z = centre
        text = XML.format(
            step=STEP,
            table=z - scene.body.height,
            x=x,
            y=y,
            z=z,
            kind=scene.body.geometry,
            mass=scene.mass,
            friction=contact,
            size=" ".join(f"{v:.6g}" for v in scene.body.sizes),
            board=scene.board_friction,
            torsion=TORSION,
            tips=tips,
            springs=springs,
        )
        self._begin, self._model = begin, engine.MjModel.from_xml_string(text)
        self._data = engine.MjData(self._model)
        self._object = self._model.body("object").id
        self._tips = [self._model.body(f"tip{k}").id for k in range(count)]
        self._object_geom = self._model.geom("object").id
        self._pad_of = np.full(self._model.ngeom, -1)
        self._pad_of[[self._model.geom(f"tip{k}").id for k in range(count)]] = range(count)
        self._data.xfrc_applied[self._object, 2] = -scene.body.pull

    def run(self, pads: np.ndarray, seconds: np.ndarray, feedback: Feedback | None = None) -> Rollout:
        """Follow pads' centres [m], shape (n, f, 3), at times [s], shape (n,), ascending from 0.

        Args:
            pads: Centres.
            seconds: Their times.
            feedback: Moves them while it runs: time [s], depth of each pad's skin [m] and time since the last call [s]
                -> displacement [m], shape (f, 3).
        """
        step = mujoco().mj_step
        rows, count = len(seconds), len(self._tips)
        moments = np.arange(-SETTLE, seconds[-1] + STEP * COMMAND, STEP * COMMAND)
        flat = pads.reshape(rows, -1)
        targets = np.stack([np.interp(moments, seconds, flat[:, c]) for c in range(flat.shape[1])], axis=1)
        rollout = Rollout(
            np.empty((rows, 3)),
            np.empty((rows, count, 3)),
            np.zeros((rows, count)),
            np.zeros((rows, count)),
            np.zeros((rows, count, 3)),
        )
        row, slid, data = 0, np.zeros((count, 3)), self._data
        depth, correction = np.zeros(count), 0.0
        for moment, command in zip(moments, targets - self._begin.ravel(), strict=True):
            data.ctrl[:] = command + correction
            step(self._model, data, COMMAND)
            contacts, touching = self._contacts()
            if feedback is not None:
                depth[:] = 0.0
                np.maximum.at(depth, touching, -data.contact.dist[contacts])
                correction = feedback(float(moment), depth, STEP * COMMAND).ravel()
            if len(contacts):
                slid[touching] += self._sliding(contacts, touching) * STEP * COMMAND
            while row < rows and seconds[row] <= moment + STEP * COMMAND:
                rollout.centre[row], rollout.tips[row] = data.xpos[self._object], data.xpos[self._tips]
                self._press(contacts, touching, rollout.force[row], rollout.depth[row])
                rollout.slid[row] = slid
                row += 1
        return rollout

    def _contacts(self) -> tuple[np.ndarray, np.ndarray]:
        """Return which of the simulation's contacts are between a pad and the object, and each one's pad."""
        geoms = self._data.contact.geom
        pads = self._pad_of[geoms].max(axis=1, initial=-1)
        contacts = np.flatnonzero((pads >= 0) & (geoms == self._object_geom).any(axis=1))
        return contacts, pads[contacts]

    def _sliding(self, contacts: np.ndarray, pads: np.ndarray) -> np.ndarray:
        """Return the object's sliding velocity along the pad at each contact [m/s], shape (k, 3)."""
        data = self._data
        a, b, c = data.xmat[self._object].reshape(3, 3) @ data.qvel[3:6]  # MuJoCo gives it about the body's axes
        arm, normal = data.contact.pos[contacts] - data.xpos[self._object], data.contact.frame[contacts, :3]
        turning = arm @ np.array([[0, c, -b], [-c, 0, a], [b, -a, 0]])
        distance = data.qvel[:3] + turning - data.qvel[6:].reshape(-1, 3)[pads]
        return distance - (distance * normal).sum(axis=1, keepdims=True) * normal

    def _press(self, contacts: np.ndarray, pads: np.ndarray, force: np.ndarray, depth: np.ndarray) -> None:
        """Write the normal force [N] and the depth [m] of each pad on the object, shapes (f,)."""
        wrench = np.zeros(6)
        for k, pad in zip(contacts.tolist(), pads.tolist(), strict=True):
            mujoco().mj_contactForce(self._model, self._data, k, wrench)
            force[pad] += wrench[0]
            depth[pad] = max(depth[pad], -float(self._data.contact.dist[k]))
