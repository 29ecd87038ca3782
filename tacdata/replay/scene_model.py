"""The scene in MuJoCo: a support, an object on it, and soft pads on springs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

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
PADS = 2
"""Collision class of pads: they touch the object and the support, not each other (MuJoCo's contype)."""
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
 </worldbody>
</mujoco>"""
IMPEDANCE = 0.9
"""Impedance of the contact between skin and object [1] (MuJoCo, solver parameters)."""


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

    links: np.ndarray
    """Ends of each link of a robot [m], shape (n, links, 2, 3); no links without a robot."""
    pads: np.ndarray
    """Shape of each pad, shape (n, f, 3, 3) [m^2]: x of its surface, from its centre, has x^T pads^-1 x = 1."""

    @property
    def slip(self) -> np.ndarray:
        """Distance that it has slid along each pad [m], shape (n, f)."""
        return np.linalg.norm(self.slid, axis=-1)


class PadDrive(Protocol):
    """Fingers of a scene: their bodies, actuators and commands."""

    def mount(self, spec: Any, scene: ReplayScene) -> None:
        """Add bodies, actuators, and a pad for each finger by `add_pad`, to MuJoCo's model of a scene."""

    def begin(self, model: Any, data: Any) -> None:
        """Bring the fingers to their start."""

    def commands(self, pads: np.ndarray, seconds: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Return the actuators' commands at moments [s], shape (m, actuators); pads and seconds as `SceneModel.run`."""
        ...

    def moved(self, displacement: np.ndarray) -> np.ndarray:
        """Return the change of the commands that moves the pads by a displacement [m], shape (f, 3), from now on."""
        ...


def add_pad(body: Any, k: int, scene: ReplayScene, sizes: Sequence[float] = (PAD, PAD, PAD), **placed: Any) -> None:
    """Add the pad of finger ``k`` to a body of MuJoCo: an ellipsoid of half axes ``sizes`` [m]."""
    kind = mujoco().mjtGeom
    body.add_geom(
        name=f"tip{k}",
        type=kind.mjGEOM_SPHERE if len(set(sizes)) == 1 else kind.mjGEOM_ELLIPSOID,
        size=list(sizes),
        mass=TIP_MASS,
        contype=PADS,
        conaffinity=1,
        condim=4,
        priority=1,
        friction=[scene.friction, TORSION, 0.0001],
        solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        **placed,
    )


def soften(model: Any, pad: int, skin: float, mass: float) -> None:
    """Give a pad of MuJoCo's model the stiffness of a skin [N/m], for contact with an object of a mass [kg]."""
    # Direct solref: a contact at rest gives way by (1 - d) force / (reduced mass * rate), with impedance d. MuJoCo's
    # mass is a mean over all directions of motion, so a link that moves along one axis counts as heavier.
    inverse = model.body_invweight0[model.geom_bodyid[pad], 0] + 1 / mass
    rate = skin * (1 - IMPEDANCE) * inverse
    model.geom_solref[pad] = -rate, -2 * np.sqrt(rate)


@dataclass(frozen=True, eq=False)
class FreePads:
    """Pads without links, each on three springs."""

    start: np.ndarray
    """Their centres at the beginning [m], shape (f, 3)."""

    def mount(self, spec: Any, scene: ReplayScene) -> None:
        """Add them."""
        slide = mujoco().mjtJoint.mjJNT_SLIDE
        for k, place in enumerate(self.start):
            body = spec.worldbody.add_body(name=f"tip{k}", pos=place, gravcomp=1)
            add_pad(body, k, scene)
            for axis in np.eye(3):
                joint = body.add_joint(name=f"tip{k}{'xyz'[int(axis.argmax())]}", type=slide, axis=axis)
                add_actuator(spec, joint.name, scene.stiffness, 2 * np.sqrt(scene.stiffness * TIP_MASS))

    def begin(self, model: Any, data: Any) -> None:
        """Leave them where they were built."""

    def commands(self, pads: np.ndarray, seconds: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Return the springs' lengths at moments [s], shape (m, 3 f)."""
        return interpolated(pads.reshape(len(pads), -1), seconds, moments) - self.start.ravel()

    def moved(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement itself."""
        return displacement.ravel()


def add_actuator(spec: Any, joint: str, stiffness: float, damping: float) -> None:
    """Hold a joint at its command by a spring [N/m or N m/rad] and a damper [N s/m or N m s/rad]."""
    actuator = spec.add_actuator(name=joint, target=joint, trntype=mujoco().mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(kp=stiffness, kv=damping)


def interpolated(values: np.ndarray, seconds: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return columns of values, shape (n, k), at other times, shape (m, k)."""
    return np.stack([np.interp(moments, seconds, column) for column in values.T], axis=1)


class SceneModel:
    """The simulation of one trial."""

    def __init__(self, scene: ReplayScene, hand: PadDrive, centre: np.ndarray) -> None:
        """Build it with a hand, and the object's centre at ``centre`` [m]."""
        engine = mujoco()
        x, y, z = centre
        text = XML.format(
            step=STEP,
            table=z - scene.body.height,
            x=x,
            y=y,
            z=z,
            kind=scene.body.geometry,
            mass=scene.mass,
            friction=f"{scene.friction:.6g}",
            size=" ".join(f"{v:.6g}" for v in scene.body.sizes),
            board=scene.board_friction,
            torsion=TORSION,
        )
        spec = engine.MjSpec.from_string(text)
        hand.mount(spec, scene)
        self._hand, self._model = hand, spec.compile()
        self._data = engine.MjData(self._model)
        self._object = self._model.body("object").id
        self._object_geom = self._model.geom("object").id
        self._pads = [k for k in range(self._model.ngeom) if self._model.geom_contype[k] == PADS]
        self._pads.sort(key=lambda k: int(self._model.geom(k).name.rpartition("tip")[2]))
        self._pad_of = np.full(self._model.ngeom, -1)
        self._pad_of[self._pads] = range(len(self._pads))
        # From each joint to the next, and from the last to the pad; nothing where a pad has no link.
        parent = self._model.body_parentid
        self._links = [(int(parent[k]), k) for k in range(self._model.nbody) if parent[k] > 0]
        for pad in self._pads:
            soften(self._model, pad, scene.skin, scene.mass)
        hand.begin(self._model, self._data)
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
        rows, count = len(seconds), len(self._pads)
        moments = np.arange(-SETTLE, seconds[-1] + STEP * COMMAND, STEP * COMMAND)
        rollout = Rollout(
            np.empty((rows, 3)),
            np.empty((rows, count, 3)),
            np.zeros((rows, count)),
            np.zeros((rows, count)),
            np.zeros((rows, count, 3)),
            np.empty((rows, len(self._links) + count if self._links else 0, 2, 3)),
            np.empty((rows, count, 3, 3)),
        )
        sizes, carriers = self._model.geom_size[self._pads], self._model.geom_bodyid[self._pads]
        row, slid, data = 0, np.zeros((count, 3)), self._data
        depth, correction = np.zeros(count), np.zeros((count, 3))
        for moment, command in zip(moments, self._hand.commands(pads, seconds, moments), strict=True):
            data.ctrl[:] = command + self._hand.moved(correction)
            step(self._model, data, COMMAND)
            contacts, touching = self._contacts()
            if feedback is not None:
                depth[:] = 0.0
                np.maximum.at(depth, touching, -data.contact.dist[contacts])
                correction = feedback(float(moment), depth, STEP * COMMAND)
            if len(contacts):
                slid[touching] += self._sliding(contacts, touching) * STEP * COMMAND
            while row < rows and seconds[row] <= moment + STEP * COMMAND:
                rollout.centre[row], rollout.tips[row] = data.xpos[self._object], data.geom_xpos[self._pads]
                self._press(contacts, touching, rollout.force[row], rollout.depth[row])
                rollout.slid[row] = slid
                turn = data.geom_xmat[self._pads].reshape(-1, 3, 3)
                rollout.pads[row] = turn * sizes[:, None, :] ** 2 @ turn.transpose(0, 2, 1)
                if self._links:
                    rollout.links[row, : len(self._links)] = data.xpos[self._links]
                    rollout.links[row, len(self._links) :] = np.stack([data.xpos[carriers], rollout.tips[row]], axis=1)
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
        distance = data.qvel[:3] + turning - self._velocity(contacts, pads)
        return distance - (distance * normal).sum(axis=1, keepdims=True) * normal

    def _velocity(self, contacts: np.ndarray, pads: np.ndarray) -> np.ndarray:
        """Return the velocity of each contact's pad there [m/s], shape (k, 3)."""
        data, jacobian = self._data, np.zeros((3, self._model.nv))
        velocities = np.empty((len(contacts), 3))
        for row, (k, pad) in enumerate(zip(contacts.tolist(), pads.tolist(), strict=True)):
            body = self._model.geom_bodyid[self._pads[pad]]
            # Not `mj_objectVelocity`: its velocities are a step older than the object's.
            mujoco().mj_jac(self._model, data, jacobian, None, data.contact.pos[k], body)
            velocities[row] = jacobian @ data.qvel
        return velocities

    def _press(self, contacts: np.ndarray, pads: np.ndarray, force: np.ndarray, depth: np.ndarray) -> None:
        """Write the normal force [N] and the depth [m] of each pad on the object, shapes (f,)."""
        wrench = np.zeros(6)
        for k, pad in zip(contacts.tolist(), pads.tolist(), strict=True):
            mujoco().mj_contactForce(self._model, self._data, k, wrench)
            force[pad] += wrench[0]
            depth[pad] = max(depth[pad], -float(self._data.contact.dist[k]))
