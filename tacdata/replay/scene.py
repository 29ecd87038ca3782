"""Robot and object of a replay: a ball on a table, or an eraser on a board, and fingertips on springs."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ReplayScene:
    """Parameters of robot and object; `drawn` gives their spreads."""

    radius: float = 0.035
    """Radius of the ball [m]."""
    mass: float = 0.18
    """Its mass [kg]: a small apple."""
    friction: float = 0.8
    """Coulomb coefficient between skin and ball [1]."""
    stiffness: float = 300.0
    """Stiffness of the springs that hold a fingertip at its target [N/m]."""
    skin: float = 3000.0
    """Stiffness of the skin [N/m]."""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Offset of the ball from its position in the demonstration [m]."""
    task: str = "grasp"
    """"grasp": a ball is lifted; "wipe": an eraser is moved to and fro on a board."""
    eraser: tuple[float, float, float] = (0.025, 0.055, 0.015)
    """Half the sizes of the eraser [m]: between the fingers, along the strokes, in height."""
    board_friction: float = 0.5
    """Coulomb coefficient between the object and what it lies on [1]."""
    pull: float = 0.0
    """Force that pulls the object onto its support, beside its weight [N]."""
    bias: tuple[tuple[float, float, float], ...] = ()
    """Offset of each fingertip's targets in the robot's frame [m]: calibration, another hand's shape."""

    @property
    def document(self) -> dict[str, Any]:
        """The scene as plain data."""
        values = asdict(self)
        lists = {"place": list(self.place), "eraser": list(self.eraser), "bias": [list(shift) for shift in self.bias]}
        return {**values, **lists}

    @property
    def geometry(self) -> str:
        """MuJoCo's name of the object's shape."""
        return "sphere" if self.task == "grasp" else "box"

    @property
    def sizes(self) -> tuple[float, ...]:
        """Its size parameters for MuJoCo [m]."""
        return (self.radius,) if self.task == "grasp" else self.eraser

    @property
    def height(self) -> float:
        """Height of its centre above the support [m]."""
        return self.radius if self.task == "grasp" else self.eraser[2]

    @property
    def reach(self) -> float:
        """Distance from its centre to the fingers' contact [m]."""
        return self.radius if self.task == "grasp" else self.eraser[0]


def scene_of(task: str, **values: Any) -> ReplayScene:
    """Return the usual scene of a task; a wipe's eraser weighs 120 g and holds to its board by a magnet of 2 N.

    Args:
        task: A demonstration's task; all but "wipe" are grasps.
        values: Fields that differ from the usual ones.
    """
    wiped: dict[str, Any] = {"mass": 0.12, "pull": 2.0} if task == "wipe" else {}
    return ReplayScene(task="wipe" if task == "wipe" else "grasp", **{**wiped, **values})


def drawn(scene: ReplayScene, fingers: int, seed: int) -> ReplayScene:
    """Return the scene of a seed: mass and stiffness +-20 %, friction +-15 %, ball +-1.5 mm, fingertips 0.7 mm."""
    rng = np.random.default_rng([seed, 21])
    x, y = rng.uniform(-0.0015, 0.0015, 2).tolist()
    shifts = rng.normal(0, 0.0007, (fingers, 3)).tolist()
    return replace(
        scene, mass=scene.mass * float(rng.uniform(0.8, 1.2)), stiffness=scene.stiffness * float(rng.uniform(0.8, 1.2)),
        friction=scene.friction * float(rng.uniform(0.85, 1.15)), place=(x, y, 0.0),
        bias=tuple((a, b, c) for a, b, c in shifts),
    )  # fmt: skip
