"""A world on disk: data for the judge in one folder, data for the scorer alone in another."""

import json

import numpy as np

from worlds import skin, world

TABLE = "nominal.npz"
"""The lab's table where it is right, shared by the worlds of a folder."""


def write(out, case):
    """Write one world, if it is not there yet; return its identity.

    ``OUT/worlds/ID`` gets recordings.npz and task.json, and table.npz if the lab's table is wrong;
    ``OUT/truth/ID.json`` and ``.npz`` get the truth.
    """
    folder, truth = out / "worlds" / case.identity, out / "truth" / f"{case.identity}.json"
    if truth.exists():
        return case.identity
    folder.mkdir(parents=True, exist_ok=True)
    truth.parent.mkdir(exist_ok=True)
    nominal = out / "worlds" / TABLE
    if not nominal.exists():
        skin.write_table(nominal, world.RADII)
    data, known, table = world.make(case.seed, case.effects, **case.settings)
    np.savez_compressed(folder / "recordings.npz", **data)
    if table:
        skin.write_table(folder / "table.npz", world.RADII, **table)
    (folder / "task.json").write_text(json.dumps({"version": "1.0", "response": case.response}))
    parameters = known.pop("parameters")
    np.savez_compressed(truth.with_suffix(".npz"), **{k: np.asarray(v, np.float32) for k, v in known.items()})
    settings = {**world.SETTINGS, **case.settings}
    document = {
        "version": "1.0",
        "id": case.identity,
        "block": case.block,
        "name": case.name,
        "seed": case.seed,
        "response": case.response,
        "settings": settings,
        "effects": case.effects,
        "times": case.times,
        "expected": case.expected,
        "parameters": parameters,
        "facts": case.facts,
    }
    written = truth.with_suffix(".new")
    written.write_text(json.dumps(document))
    written.replace(truth)
    return case.identity
