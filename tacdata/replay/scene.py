"""Robot and object of a replay: a support, an object on it, and fingertips on springs."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.replay.grasp import ObjectPlace

GRAVITY = 9.81
"""[m/s^2]"""
SPREADS: dict[str, dict[str, Any]] = {
    "mass": {"distribution": "uniform", "half_width": 0.2, "unit": "1", "of": "the scene's value"},
    "stiffness": {"distribution": "uniform", "half_width": 0.2, "unit": "1", "of": "the scene's value"},
    "friction": {"distribution": "uniform", "half_width": 0.15, "unit": "1", "of": "the scene's value"},
    "place": {"distribution": "uniform", "half_width": 0.0015, "unit": "m", "of": "x and y of the object"},
    "bias": {"distribution": "normal", "sd": 0.0007, "unit": "m", "of": "each axis of each fingertip's targets"},
}
"""How a seed's scene differs from the undisturbed one; `drawn` draws from it."""


@dataclass(frozen=True)
class ReplayObject:
    """Object that is lifted or wiped with."""

    geometry: str
    """MuJoCo's name of its shape."""
    sizes: tuple[float, ...]
    """MuJoCo's sizes [m]: radius, radius and half the height, or half the sizes; the first is between the fingers."""
    mass: float
    """[kg]"""
    pull: float = 0.0
    """Force that pulls it onto its support, in addition to its weight [N]."""
    strength: float = 4.5
    """Largest force of a pad that it withstands where it is fragile [N]: 1.5 times that of the emulated hands."""

    @property
    def height(self) -> float:
        """Height of its centre above the support [m]."""
        return self.sizes[-1]


OBJECTS = {
    "ball": ReplayObject("sphere", (0.035,), 0.18),
    "can": ReplayObject("cylinder", (0.033, 0.05), 0.2),
    "box": ReplayObject("box", (0.03, 0.04, 0.045), 0.15),
    "eraser": ReplayObject("box", (0.025, 0.055, 0.015), 0.12, pull=2.0),
}
"""A small apple, a can that is half empty, a carton, and an eraser that a magnet holds to its board."""
SIZES = {"sphere": 1, "cylinder": 2, "box": 3}
"""Shape -> number of its sizes."""


@dataclass(frozen=True)
class ReplayScene:
    """Parameters of robot and object; `SPREADS` are theirs over seeds."""

    name: str = "ball"
    """Name of the object."""
    body: ReplayObject = OBJECTS["ball"]
    """The object."""
    mass: float = OBJECTS["ball"].mass
    """Its mass in this scene [kg]."""
    friction: float = 0.8
    """Coulomb coefficient between skin and object [1]."""
    stiffness: float = 300.0
    """Stiffness of the springs that hold a fingertip at its target [N/m]."""
    skin: float = 3000.0
    """Stiffness of the skin [N/m]."""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Offset of the object from its position in the demonstration [m]."""
    task: str = "grasp"
    """"grasp": the object is lifted; "wipe": it is moved to and fro on its support."""
    board_friction: float = 0.5
    """Coulomb coefficient between the object and its support [1]."""
    bias: tuple[tuple[float, float, float], ...] = ()
    """Offset of each fingertip's targets in the robot's frame [m]: calibration, another hand's shape."""

    @property
    def document(self) -> dict[str, Any]:
        """The scene as plain data."""
        values = asdict(self)
        body = {**values.pop("body"), "sizes": list(self.body.sizes)}
        del body["mass"]  # the scene's own counts
        return {**values, **body, "place": list(self.place), "bias": [list(shift) for shift in self.bias]}

    @property
    def reach(self) -> float:
        """Distance from the object's centre to the fingers' contact [m]."""
        return self.body.sizes[0]

    @property
    def load(self) -> float:
        """Force that friction at the fingers must carry [N]: the weight of a lifted object, or the drag of a wipe."""
        weight = self.mass * GRAVITY
        return weight if self.task == "grasp" else self.board_friction * (weight + self.body.pull)


def scene_of(task: str, name: str | None = None, width: float | None = None, **values: Any) -> ReplayScene:
    """Return the usual scene of a task.

    Args:
        task: A demonstration's task; all but "wipe" are grasps.
        name: One of `OBJECTS`, or a name for a ``body``; by default an eraser to wipe with, and else a ball.
        width: Half its width between the fingers, a ball's radius [m]; by default the object's own.
        values: Fields that differ from the usual ones.

    Raises:
        UsageError: If there is no such object.
    """
    wiped = task == "wipe"
    item = name or ("eraser" if wiped else "ball")
    body = values.pop("body", OBJECTS.get(item))
    if body is None:
        raise UsageError(f"object {item!r}", ", ".join(OBJECTS), "name one of them, or an object file (.yaml)")
    if width is not None:
        body = replace(body, sizes=(width, *body.sizes[1:]))
    usual: dict[str, Any] = {"mass": body.mass, "task": "wipe" if wiped else "grasp"}
    return ReplayScene(item, body, **usual | values)


def read_object(path: Path, frames: set[str]) -> tuple[dict[str, Any], ObjectPlace | None]:
    """Read an object file (`schemas/replay_object.schema.json`).

    Args:
        path: The file.
        frames: Frames of the demonstrations.

    Returns:
        Fields of a `ReplayScene`, and the object's place if the file states one.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it breaks its schema, has another number of sizes than its shape, or is in another frame.
    """
    document = documents.read(path, "replay_object")
    shape, sizes = document["geometry"], tuple(map(float, document["sizes"]))
    if len(sizes) != SIZES[shape]:
        raise FormatError(f"{path}: {len(sizes)} sizes of a {shape}", f"{SIZES[shape]}", "correct sizes [m]")
    values: dict[str, Any] = {name: float(document[name]) for name in ("mass", "friction") if name in document}
    own = {name: float(document[name]) for name in ("pull", "strength") if name in document}
    values |= {"name": document["name"], "body": ReplayObject(shape, sizes, values["mass"], **own)}
    if (stated := document.get("place")) is None:
        return values, None
    if {stated["frame"]} != frames:
        fault = f"{path}: a place in frame {stated['frame']!r}"
        raise FormatError(fault, f"the demonstrations' frame, {', '.join(sorted(frames))}", "state it in that frame")
    return values, ObjectPlace(np.array(stated["position"], float), np.full(3, float(stated["spread"])), str(path))


def drawn(scene: ReplayScene, fingers: int, seed: int, spread: np.ndarray | None = None) -> ReplayScene:
    """Return the scene of a seed, with the spreads of `SPREADS`, and that of the object's place [m], shape (3,)."""
    rng = np.random.default_rng([seed, 21])

    def off(name: str) -> float:
        return float(rng.uniform(-SPREADS[name]["half_width"], SPREADS[name]["half_width"]))

    # The order of the draws decides the scene of a seed: a further spread is drawn last.
    place, bias = np.array([off("place"), off("place"), 0.0]), rng.normal(0, SPREADS["bias"]["sd"], (fingers, 3))
    shares = {name: getattr(scene, name) * (1 + off(name)) for name in ("mass", "stiffness", "friction")}
    x, y, z = (place + rng.normal(0, 0.0 if spread is None else spread, 3)).tolist()
    return replace(scene, **shares, place=(x, y, z), bias=tuple((a, b, c) for a, b, c in bias.tolist()))
