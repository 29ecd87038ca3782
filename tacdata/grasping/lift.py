"""The lift in MuJoCo: two fingertips take an orange off a table, rise and hold it.

The simulation does not know the band. The hand lifts in another configuration than it measures in (paper, Exp. 3). The
fingertips are turned and farther apart, and touch with the rounded ridge at the middle of their pads instead of the
flat skin.

Away from its largest section an orange is thinner and its faces lean outwards. Ridges at a given distance then press it
less and push it out. Contact, friction and gravity decide the result.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from tacdata.replay.engine import mujoco
from tacdata.replay.scene_model import IMPEDANCE, soften

STEP = 0.001
"""Time step [s]."""
CLOSE, RISE, HOLD = 0.5, 1.0, 5.0
"""Time to close, to rise, and to hold [s]; the last is the paper's."""
HEIGHT = 0.05
"""Rise of the hand [m] (paper)."""
STAYS = 0.8
"""Share of the height above which an object counts as held, throughout the hold [1]."""
# Elliptic cones, and friction harder than the normal contact (impratio): an object that friction alone holds would
# creep.
XML = """
<mujoco>
 <option timestep="{step}" cone="elliptic" integrator="implicitfast" impratio="100"/>
 <worldbody>
  <geom name="table" type="plane" size="1 1 0.1" pos="0 0 {table}" friction="0.5 0.005 0.0001"/>
  <body name="orange"><freejoint/>
   <geom name="orange" type="sphere" size="{radius}" mass="{mass}" condim="4" friction="{friction} {torsion} 0.0001"/>
  </body>
  <body name="hand" gravcomp="1"><joint name="rise" type="slide" axis="0 0 1" damping="20"/>
   <geom type="sphere" size="0.001" mass="1" contype="0" conaffinity="0" pos="0 0 0.3"/>
   {fingers}
  </body>
 </worldbody>
 <actuator><position name="rise" joint="rise" kp="20000" kv="400"/>{springs}</actuator>
</mujoco>"""
# Their masks (contype, conaffinity) let fingers touch the orange, but not each other.
FINGER = """<body name="{name}" pos="0 {y} 0" gravcomp="1"><joint name="{name}" type="slide" axis="0 {inwards} 0"/>
  <geom name="{name}" type="capsule" size="{ridge} {half}" mass="{mass}" contype="2" conaffinity="1" condim="4"
   priority="1" friction="{friction} {torsion} 0.0001" solimp="{d} {d} 0.001"/></body>"""
TORSION, FINGER_MASS = 0.003, 0.05
"""Friction against turning about the normal [m], and mass [kg]."""
SIDES = {"near": -1, "far": 1}


@dataclass(frozen=True)
class Grip:
    """Hand and object of a lift."""

    radius: float = 0.035
    """Radius of the orange [m]."""
    mass: float = 0.06
    """Its mass [kg]: a hollow model."""
    friction: float = 0.2
    """Coulomb coefficient between skin and orange [1], the sensor file's."""
    squeeze: float = 0.001
    """Distance of each fingertip's target beyond the surface of a centred orange [m]; fingertips farther apart squeeze
    less.
    """
    stiffness: float = 3000.0
    """Stiffness of a finger that holds its position [N/m]."""
    skin: float = 3000.0
    """Stiffness of the skin [N/m]."""
    ridge: float = 0.008
    """Radius of the ridge [m]: half the pad's width."""
    half: float = 0.006
    """Half the length of the ridge, which is vertical [m]."""

    @property
    def document(self) -> dict[str, Any]:
        """The grip as plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Lift:
    """Result of a lift."""

    held: bool
    lowest: float
    """Least rise of the orange during the hold [m]."""
    time: np.ndarray
    """Times [s], shape (n,)."""
    orange: np.ndarray
    """Its centre [m], shape (n, 3)."""
    hand: np.ndarray
    """Height of the hand [m], shape (n,)."""


def lift(grip: Grip, lateral: float, vertical: float = 0.0) -> Lift:
    """Return the result for an orange off the fingertips' middle.

    Args:
        grip: Hand and object.
        lateral: Offset of the orange to +x [m].
        vertical: Height of its centre above the pads' middle [m].
    """
    model, data = _built(grip, vertical)
    data.qpos[:3] = lateral, 0.0, vertical
    orange, engine = model.body("orange").id, mujoco()
    end = CLOSE + RISE + HOLD
    # Five steps at a time: the path is drawn, not differentiated.
    moments = np.arange(0.0, end, STEP * 5)
    path, hand = np.empty((len(moments), 3)), np.empty(len(moments))
    for k, moment in enumerate(moments):
        closing = min(moment / CLOSE, 1.0) * grip.squeeze
        rise = float(np.clip((moment - CLOSE) / RISE, 0.0, 1.0))
        # Smoothly: a jump of the hand's speed would shake the orange loose.
        hand[k] = HEIGHT * rise * rise * (3 - 2 * rise)
        data.ctrl[:] = hand[k], closing, closing
        engine.mj_step(model, data, 5)
        path[k] = data.xpos[orange]
    # During the hold alone: a slip on the way up that is caught again counts as held.
    lowest = float((path[moments > end - HOLD, 2] - vertical).min())
    return Lift(lowest > STAYS * HEIGHT, lowest, moments, path, hand)


def pressing(grip: Grip, force: float) -> Grip:
    """Return the grip whose fingertips each press a centred orange with a force [N]: finger and skin in series."""
    return replace(grip, squeeze=force / grip.stiffness + force / grip.skin)


def _built(grip: Grip, vertical: float) -> tuple[Any, Any]:
    sizes = {**asdict(grip), "torsion": TORSION}
    fingers = "".join(
        FINGER.format(
            **{**sizes, "mass": FINGER_MASS}, name=name, y=side * (grip.radius + grip.ridge), inwards=-side, d=IMPEDANCE
        )
        for name, side in SIDES.items()
    )
    # Critically damped: swinging fingers would shake the orange.
    critical = 2 * np.sqrt(grip.stiffness * FINGER_MASS)
    springs = "".join(f'<position name="{n}" joint="{n}" kp="{grip.stiffness}" kv="{critical}"/>' for n in SIDES)
    text = XML.format(**sizes, step=STEP, table=vertical - grip.radius, fingers=fingers, springs=springs)
    engine = mujoco()
    model = engine.MjModel.from_xml_string(text)
    for name in SIDES:
        # MuJoCo's usual contact is far stiffer than the skin.
        soften(model, model.geom(name).id, grip.skin, grip.mass)
    return model, engine.MjData(model)
