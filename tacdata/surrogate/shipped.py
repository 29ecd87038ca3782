"""Presses that ship with tacdata: of the default sensor, on its default mesh, under round tools.

Made by `python -m tacdata.surrogate.pin_presses`. They are found by sensor and mesh, whatever the version of the code;
a test compares one of them with today's model.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.sensor import Sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.press import PressRequest
from tacdata.surrogate.solved import Solved
from tacdata.transduction import Loads

FOLDER = Path(__file__).parent / "presses"


def shelf(sensor: Sensor, mesh: MeshSettings) -> str:
    """Return the folder name of such presses: a hash of sensor (without its readings) and mesh."""
    # Transduction turns loads into readings and is no part of a solved press.
    document = sensor.document
    physical = {name: document[name] for name in ("taxels", "skin", "material", "contact")}
    return provenance.content_hash({"sensor": physical, "mesh": asdict(mesh)})[:16]


@dataclass(frozen=True)
class Shipped:
    """The presses that ship for one sensor and mesh."""

    folder: Path

    @classmethod
    def of(cls, sensor: Sensor, mesh: MeshSettings) -> Shipped:
        """Return the shipped presses; there may be none."""
        return cls(FOLDER / shelf(sensor, mesh))

    def path(self, indenter: dict) -> Path:
        """Return the path of an indenter's presses, existing or not."""
        return self.folder / f"{provenance.content_hash(indenter)[:16]}.npz"

    def get(self, request: PressRequest) -> Solved | None:
        """Return a press if it ships; only upright ones do."""
        # The file of an indenter is indexed by place and yaw alone.
        if request.tilt_x or request.tilt_y:
            return None
        press = _read(self.path(request.indenter.document)).get((request.x, request.y, request.yaw))
        return press.down_to(request.depths) if press else None


# Hundreds of presses are asked for one by one, and all are in one file.
@cache
def _read(path: Path) -> dict[tuple[float, float, float], Solved]:
    if not path.is_file():
        return {}
    with np.load(path, allow_pickle=False) as data:
        places, counts, depths, ended = data["places"], data["counts"], data["depths"], data["ended"]
        values = [data[name].astype(float) for name in ("force", "closure", "area", "normal")]
    presses = {}
    for k, (x, y, yaw) in enumerate(places.tolist()):
        force, closure, area, normal = (value[k, : counts[k]] for value in values)
        presses[(x, y, yaw)] = Solved(depths[: counts[k]], Loads(force, closure, area), normal, 0.0, bool(ended[k]))
    return presses
