"""Judge blocks of hidden worlds, one file a world: python run.py OUT BLOCK... [--shard K/N] [--seed FIRST]."""

import json
import sys
import tempfile
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import cases
import numpy as np
import skin
import world

from tacdata.chain import Course, Tool
from tacdata.chain.rows import rows_of
from tacdata.chain.table_response import TableResponse
from tacdata.discrepancy import decide
from tacdata.discrepancy.fitted_response import FittedResponse
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.problem import Setting
from tacdata.effects import library


def course_of(data):
    """Return the recordings of a world as the workflow takes them."""
    parts = []
    for e in range(int(data["episode"].max()) + 1):
        rows, way = data["episode"] == e, data["path_episode"] == e
        parts.append(rows_of(data["time"][rows], data["readings"][rows].astype(float), data["path_time"][way],
                             data["path"][way]))
    count = [len(p.time) for p in parts]
    episode = np.repeat(np.arange(len(parts)), count)
    tool = np.array([data["tool"][data["episode"] == e][0] for e in range(len(parts))], dtype=int)
    return Course(
        time=np.concatenate([p.time for p in parts]), episode=episode, tip=np.concatenate([p.tip for p in parts]),
        tool=tool[episode], readings=np.concatenate([p.values for p in parts]),
        averaged=np.concatenate([p.averaged for p in parts]), session=np.zeros(len(parts), int),
        site=np.asarray(data["site"], int),
        tools=tuple(Tool(f"sphere_{r:g}", "sphere", float(r)) for r in data["radii"]),
        names=tuple(f"episode {k}" for k in range(len(parts))), centers=data["centers"],
    )


def answer(data, response, table):
    """Return the verdict on a world as plain data, with what it rests on."""
    course = course_of(data)
    start = time.process_time()
    quiet = course.reduced.tip[:, 2] <= 0
    given = table.idling_at(np.median(course.reduced.readings[quiet], axis=0))
    found = judge(Setting(course, given if response == "table" else FittedResponse(course), library()))
    return {
        "status": decide.status(found), "seconds": time.process_time() - start,
        "p": float(found.tested.p.min()), "p_generic": found.tested.p_generic, "share_left": found.share_left,
        "left": found.left.gain, "left_t": found.left.t, "explained": found.explained,
        "members": [
            {"mechanism": m.placed.effect.called, "effect": m.placed.effect.name, "rivals": list(m.rivals),
             "margins": {k: float(v) for k, v in m.margins.items()}, "necessity": float(m.necessity),
             "at_bound": list(m.at_bound),
             "values": {k: np.asarray(v).tolist() for k, v in m.placed.values.items()}, "error": m.error}
            for m in decide.members(found)
        ],
    }


def main(out, blocks, shard, first):
    """Judge what is not judged yet."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        skin.write_table(Path(folder) / "table.npz", world.RADII)
        table = TableResponse.read(Path(folder) / "table.npz")
    k, n = shard
    wanted = [case for block in blocks for case in cases.cases(block, first)]
    for number, (name, seed, effects, settings, response) in enumerate(wanted):
        path = out / f"{name}-{seed}.json"
        if number % n != k or path.exists():
            continue
        try:
            given = answer(world.make(seed, effects, **settings), response, table)
        except Exception:
            given = {"status": "crashed", "error": traceback.format_exc(), "members": []}
        path.write_text(json.dumps({"name": name, "truth": effects, "response": response, **settings, **given}))
        told = [(m["effect"], m["rivals"]) for m in given["members"]]
        print(name, given["status"], told, f"{given.get('share_left', 0):.3f}", f"{given.get('left_t', 0):.1f}",
              f"{given.get('seconds', 0):.0f}s", flush=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    option = {words[i]: words[i + 1] for i in range(len(words)) if words[i].startswith("--")}
    plain = [w for i, w in enumerate(words) if not w.startswith("--") and not (i and words[i - 1].startswith("--"))]
    part, whole = option.get("--shard", "0/1").split("/")
    main(Path(plain[0]), plain[1:], (int(part), int(whole)), int(option.get("--seed", 1000)))
