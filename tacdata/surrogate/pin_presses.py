"""Solves the presses that ship: `python -m tacdata.surrogate.pin_presses --device cuda:0`."""

from __future__ import annotations

import argparse
import io
from dataclasses import asdict
from typing import Any

import numpy as np

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.indenters import from_document
from tacdata.plans.specimens import specimens
from tacdata.replacement import replacement
from tacdata.sensor import default_sensor
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.surrogate.grid import UNIT, Reach, request
from tacdata.surrogate.press_store import PressStore
from tacdata.surrogate.shipped import Shipped
from tacdata.surrogate.solved import Solved

TOOLS = ("sphere_2", "sphere_4", "punch", "ring", "cone")
"""Tools that are round, so that a quarter of the positions suffices."""
SPACING, COLUMNS, ROWS, STATES = 0.8, 8, 6, 17
"""Spacing of the positions [mm], number of positions along x and y from the middle, number of depths."""


def main() -> None:
    """Solve and write the presses of every tool."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--capacity", type=int, default=1)
    arguments = parser.parse_args()
    model = SkinModel(default_sensor(), ModelSettings(error_estimate=False), arguments.device)
    store = PressStore.of(model)
    for name, document in specimens(TOOLS).items():
        reach = Reach(from_document(document, name), 0.0, (0.0, 0.0), (0.0, 0.0), 0.0)
        depths = UNIT * np.arange(STATES) ** 2
        places = [(SPACING * i, SPACING * j) for i in range(COLUMNS) for j in range(ROWS)]
        presses = [p for x, y in places if (p := request(reach, x, y, depths, model.sensor)) is not None]
        solved = store.solve(
            presses, arguments.capacity, lambda done, of, left: print(f"{done} of {of}, {left:.0f} s left")
        )
        _write(model, name, presses, solved, depths)


def _write(
    model: SkinModel, name: str, presses: list[PressRequest], solved: list[Solved | SolveError], depths: np.ndarray
) -> None:
    for answer in solved:
        if isinstance(answer, SolveError):
            raise answer
    solutions = [s for s in solved if isinstance(s, Solved)]

    def padded(values: list[np.ndarray]) -> np.ndarray:
        result = np.zeros((len(values), len(depths), *values[0].shape[1:]), dtype=np.float32)
        for k, value in enumerate(values):
            result[k, : len(value)] = value
        return result

    stamp = provenance.stamp("tacdata.surrogate.pin_presses", dict(model.identity), asdict(model.settings))
    loads: Any = {n: padded([getattr(s.loads, n) for s in solutions]) for n in ("force", "closure", "area")}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        places=np.array([(p.x, p.y, p.yaw) for p in presses]),
        counts=np.array([len(s.depths) for s in solutions]),
        ended=np.array([s.ended for s in solutions]),
        depths=depths,
        **loads,
        normal=padded([s.normal for s in solutions]),
        provenance=np.array(provenance.canonical(stamp)),
    )
    shipped = Shipped.of(model.sensor, model.settings.mesh)
    path = shipped.path(presses[0].indenter.document)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacement(path) as stream:
        stream.write(buffer.getvalue())
    print(f"{name}: {len(solutions)} presses in {path}")


if __name__ == "__main__":
    main()
