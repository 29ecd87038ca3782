"""A bench whose readings come late or whose drive has play: imported recordings and a verdict, made without judging."""

import numpy as np
import yaml

from tacdata import documents, provenance, schemas
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.run import recording_hash
from tacdata.effects import load
from tacdata.importing.imported_session import import_session

MAPPING = {
    "version": "1.0",
    "name": "bench",
    "files": {"log": {"path": "press_{trial}.csv", "time": {"column": "t", "unit": "s", "zero": "shared"}}},
    "sensor": {"name": "two pads", "columns": 2, "rows": 1, "pitch_x": 4.0, "pitch_y": 4.0},
    "taxels": {"file": "log", "columns": ["a", "b"], "unit": "pF"},
    "position": {"file": "log", "depth": {"column": "depth", "unit": "mm"}},
    "indenter": {"shape": "sphere", "radius": 3.0},
}


def record(folder, late=0.0, play=0.0, episodes=16, rates=(0.5, 1.5), seed=3):
    """Write presses at some rates whose readings come late [s] from a drive with play [mm]; return the session."""
    rng, clock = np.random.default_rng(seed), 0.0
    folder.mkdir(parents=True)
    for k in range(episodes):
        way = rates[k % len(rates)]
        at = np.cumsum([0, 1.0, way, 1.5, way, 1.5])
        depth = np.array([-0.3, -0.3, 1.0, 1.0, -0.3, -0.3])
        fine = np.arange(0, at[-1], 0.001)
        true, follower = np.interp(fine - late, at, depth), -0.3
        if play:
            for i, z in enumerate(true):
                follower = min(max(follower, z), z + play)
                true[i] = follower
        time = np.arange(0, at[-1], 0.04)
        load_now = np.maximum(np.interp(time, fine, true), 0) ** 1.5
        lines = ["t,depth,a,b"]
        for t, d, s in zip(time, np.interp(time, at, depth), load_now, strict=True):
            a, b = 100 + 50 * s + 0.1 * rng.normal(), 90 + 20 * s + 0.1 * rng.normal()
            lines.append(f"{clock + t:.4f},{d:.5f},{a:.4f},{b:.4f}")
        (folder / f"press_{k:02d}.csv").write_text("\n".join(lines))
        clock += at[-1] + 2
    (folder / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    return import_session(folder, folder / "mapping.yaml", folder / "session").folder


def verdict(folder, effect, values, status="named", alternatives=(), session=None):
    """Write a verdict's folder that names an effect, as `tacdata discrepancy` would; return the folder."""
    kind = load(effect)
    spec = read_spec(None)
    known = {} if session is None else {f"recording {session.name}": recording_hash(session)}
    entry = {
        "mechanism": kind.called,
        "effect": effect,
        "title": kind.title,
        "stage": kind.stage,
        "family": kind.family.value,
        "level": None if status == "unknown" or alternatives else "mechanism",
        "probability": {"family": 0.99, "mechanism": 0.99, "form": 0.99},
        "moves": list(kind.moves),
        "status": "suspected" if status == "unknown" else "ambiguous" if alternatives else "named",
        "alternatives": list(alternatives),
        "parameters": {
            n: {"value": v, "unit": "u", "error": 0.01, "interval": [v - 0.02, v + 0.02]} for n, v in values.items()
        },
        "rivals": {},
        "experiment": kind.experiment,
    }
    document = {
        "version": schemas.version("verdict"),
        "status": status,
        "why": "made up for a test",
        "effects": [entry],
        "posterior": {
            "nothing": 0.001,
            "remainder": 0.02,
            "mechanisms": {kind.called: 0.99},
            "families": {},
            "sets": [],
            "policy": {"named": 0.95},
            "policy_hash": "0",
        },
        "gap": {"seen": True, "before": 9.0, "after": 1.0, "floor": 1.0, "noise": [0.1, 0.1], "memory": 0.0},
        "located": [],
        "unjudgeable": {},
        "limits": {},
        "untested": [],
        "data": {"episodes": 16},
        "remarks": [],
        "next": [],
        "provenance": provenance.stamp("test", {"spec": spec.content_hash, **known}, {}),
    }
    folder.mkdir()
    documents.write(folder / "verdict.json", document, "verdict")
    return folder
