"""The scene in MuJoCo: a table, a ball or an eraser, and soft pads on springs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.replay.engine import mujoco
from tacdata.replay.scene import ReplayScene

STEP = 0.001
"""Time step of the simulation [s]."""
COMMAND = 5
"""Steps between two commands to the fingertips [count]: 200 Hz."""
SETTLE = 0.3
"""Time before the replay in which the ball comes to rest [s]."""
PAD = 0.009
"""Radius of a fingertip's pad [m]."""
TIP_MASS = 0.05
"""Mass that moves with a fingertip [kg]."""
TORSION = 0.003
"""Coefficient of torsional friction about a contact's normal [m]: a patch of a few millimetres."""
XML = """
<mujoco>
 <option timestep="{step}" cone="elliptic" integrator="implicitfast" impratio="10"/>
 <worldbody>
  <geom name="table" type="plane" size="1 1 0.1" pos="0 0 {table}" friction="{board} 0.005 0.0001" priority="2"/>
  <body name="ball" pos="{x} {y} {z}">
   <freejoint/>
   <geom name="ball" type="{kind}" size="{size}" mass="{mass}" condim="4" friction="{friction} {torsion} 0.0001"/>
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
"""Impedance of the contact between skin and ball [1] (MuJoCo, solver parameters)."""
SPRING = '<position name="{joint}" joint="{joint}" kp="{kp}" kv="{kv}"/>'


@dataclass(frozen=True, eq=False)
class Rollout:
    """State of the simulation at the times of the targets."""

    ball: np.ndarray
    """Centre of the ball [m], shape (n, 3)."""
    tips: np.ndarray
    """Centres of the pads [m], shape (n, f, 3)."""
    force: np.ndarray
    """Normal force of each pad on the ball [N], shape (n, f)."""
    depth: np.ndarray
    """Depth of each pad's skin [m], shape (n, f)."""


class SceneModel:
    """The simulation of one trial."""

    def __init__(self, scene: ReplayScene, begin: np.ndarray, centre: np.ndarray) -> None:
        """Build it with the pads' centres at ``begin`` [m], shape (f, 3), and the ball's at ``centre`` [m]."""
        engine = mujoco()
        count, critical = len(begin), 2 * np.sqrt(scene.stiffness * TIP_MASS)
        contact = f"{scene.friction:.6g}"
        # MuJoCo's direct solref: a contact at rest gives way by (1 - d) force / (mass rate), with impedance d.
        reduced = TIP_MASS * scene.mass / (TIP_MASS + scene.mass)
        rate = scene.skin * (1 - IMPEDANCE) / reduced
        tips = "".join(
            TIP.format(
                k=k, x=place[0], y=place[1], z=place[2], pad=PAD, mass=TIP_MASS, friction=contact, torsion=TORSION,
                skin=rate, damping=2 * np.sqrt(rate), impedance=IMPEDANCE,
            )
            for k, place in enumerate(begin)
        )  # fmt: skip
        joints = [f"tip{k}{axis}" for k in range(count) for axis in "xyz"]
        springs = "".join(SPRING.format(joint=joint, kp=scene.stiffness, kv=critical) for joint in joints)
        x, y, z = centre
        text = XML.format(
            step=STEP, table=z - scene.height, x=x, y=y, z=z, kind=scene.geometry, mass=scene.mass, friction=contact,
            size=" ".join(f"{v:.6g}" for v in scene.sizes), board=scene.board_friction, torsion=TORSION,
            tips=tips, springs=springs,
        )  # fmt: skip
        self._begin, self._model = begin, engine.MjModel.from_xml_string(text)
        self._data = engine.MjData(self._model)
        self._ball = self._model.body("ball").id
        self._tips = [self._model.body(f"tip{k}").id for k in range(count)]
        self._pads = {self._model.geom(f"tip{k}").id: k for k in range(count)}
        self._ball_geom = self._model.geom("ball").id
        self._data.xfrc_applied[self._ball, 2] = -scene.pull

    def run(self, pads: np.ndarray, seconds: np.ndarray) -> Rollout:
        """Follow pads' centres [m], shape (n, f, 3), at times [s], shape (n,), ascending from 0."""
        engine = mujoco()
        count = len(self._tips)
        moments = np.arange(-SETTLE, seconds[-1] + STEP * COMMAND, STEP * COMMAND)
        flat = pads.reshape(len(pads), -1)
        wanted = np.stack([np.interp(moments, seconds, flat[:, c]) for c in range(flat.shape[1])], axis=1)
        ball, tips = np.empty((len(seconds), 3)), np.empty((len(seconds), count, 3))
        force, depth, row = np.zeros((len(seconds), count)), np.zeros((len(seconds), count)), 0
        for moment, command in zip(moments, wanted, strict=True):
            self._data.ctrl[:] = command - self._begin.ravel()
            engine.mj_step(self._model, self._data, COMMAND)
            while row < len(seconds) and seconds[row] <= moment + STEP * COMMAND:
                ball[row], tips[row] = self._data.xpos[self._ball], self._data.xpos[self._tips]
                force[row], depth[row] = self._contacts(count)
                row += 1
        return Rollout(ball, tips, force, depth)

    def _contacts(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return normal force [N] and depth [m] of each pad on the ball, shapes (f,)."""
        engine = mujoco()
        force, depth, wrench = np.zeros(count), np.zeros(count), np.zeros(6)
        for k in range(self._data.ncon):
            contact = self._data.contact[k]
            pair = {int(contact.geom1), int(contact.geom2)}
            pad = next((self._pads[geom] for geom in pair if geom in self._pads), None)
            if pad is None or self._ball_geom not in pair:
                continue
            engine.mj_contactForce(self._model, self._data, k, wrench)
            force[pad] += wrench[0]
            depth[pad] = max(depth[pad], -float(contact.dist))
        return force, depth
