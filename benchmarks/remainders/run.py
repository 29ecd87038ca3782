"""Names despite a remainder of a known share: python run.py OUT --shares 0.05 0.15 0.3 0.5 --count 60 [--help].

Worlds are made and judged in one process; each verdict is kept, and judged worlds are not judged again. `--score`
prints how often a family and a mechanism were right and wrong, by share.
"""

import argparse
import json
import time
from collections import Counter
from pathlib import Path

import numpy as np
from worlds import EFFECTS, FAMILIES, KINDS, REMAINDERS, made

LIBRARY = (
    "relaxation",
    "power_creep",
    "creep",
    "softening",
    "proportional_hysteresis",
    "bouc_wen",
    "backlash",
    "latency",
    "low_pass_filter",
    "quantization_hysteresis",
    "drift",
    "gain_drift",
)
"""Effects that are tried: enough to be confused, few enough for many worlds."""
COLUMNS = ("family right", "family wrong", "mechanism right", "mechanism wrong")


def course_of(presses):
    """Return presses as the workflow takes them."""
    from tacdata.chain import Course, Tool
    from tacdata.chain.rows import rows_of

    parts, sites = [], []
    for time_s, readings, path_time, depth, site in presses:
        path = np.column_stack([5.0 * site + 0 * depth, 0 * depth, depth])
        parts.append(rows_of(time_s, readings.astype(float), path_time, path, readings.shape[1]))
        sites.append(site)
    episode = np.repeat(np.arange(len(parts)), [len(p.time) for p in parts])
    return Course(
        time=np.concatenate([p.time for p in parts]),
        episode=episode,
        tip=np.concatenate([p.tip for p in parts]),
        tool=np.zeros(len(episode), dtype=int),
        readings=np.concatenate([p.values for p in parts]),
        averaged=np.concatenate([p.averaged for p in parts]),
        session=np.zeros(len(parts), dtype=int),
        site=np.array(sites),
        tools=(Tool("ball", "sphere", 4.0),),
        names=tuple(f"press {k}" for k in range(len(parts))),
        centers=np.array([[0.0, 0], [2.5, 0], [5.0, 0]]),
    )


def worlds(share, count, seed):
    """Yield seed, kind and remainder of worlds with a share: 0 is nothing at all, 1 a remainder alone."""
    rng = np.random.default_rng([seed, int(100 * share)])
    for k in range(count):
        kind = "nothing" if share in (0.0, 1.0) else KINDS[k % len(KINDS)]
        remainder = "" if share == 0 else tuple(REMAINDERS)[(k + int(rng.integers(2))) % len(REMAINDERS)]
        yield seed + k, kind, remainder


def judged(out, share, seed, kind, remainder):
    """Judge one world, or read its verdict."""
    path = out / f"{seed}-{kind}-{remainder}-{share:g}.json".replace(" ", "_")
    if not path.exists():
        from tacdata.discrepancy import judge as workflow
        from tacdata.discrepancy.model.spec import read_spec
        from tacdata.discrepancy.regressors import model_error
        from tacdata.effects import load

        few = tuple(load(name) for name in LIBRARY)
        workflow.library = model_error.library = lambda: few
        presses, strength = made(seed, kind, remainder, share)
        begun = time.process_time()
        verdict = workflow.judge(course_of(presses), read_spec(None)).document
        row = {
            "share": share,
            "kind": kind,
            "remainder": remainder,
            "strength": strength,
            "seconds": time.process_time() - begun,
            "verdict": verdict,
        }
        path.write_text(json.dumps(row))
    return json.loads(path.read_text())


def outcome(row):
    """Return whether a verdict fits the true effects, by mechanism and by family."""
    from tacdata.effects import load

    verdict, right = row["verdict"], set(EFFECTS[row["kind"]].called)
    families = {load(name).family.value for name in right} or set(FAMILIES.get(row["remainder"], ()))
    named = [e for e in verdict["effects"] if e["status"] == "named" and e.get("level")]
    mechanisms = {e["mechanism"] for e in named if e["level"] != "family"}
    wrong = mechanisms - right
    wrong_family = {e["family"] for e in named} - families - set(FAMILIES.get(row["remainder"], ()))
    return {
        "status": verdict["status"],
        "family right": bool({e["family"] for e in named} & families) and not wrong_family,
        "family wrong": bool(wrong_family),
        "mechanism right": bool(mechanisms & right) and not wrong,
        "mechanism wrong": bool(wrong),
    }


def score(out):
    """Print how often names were right, by share."""
    rows = [json.loads(p.read_text()) for p in sorted(out.glob("*.json"))]
    print(f"| share | worlds | {' | '.join(COLUMNS)} | statuses |")
    print("|---:|---:|---:|---:|---:|---:|---|")
    for share in sorted({r["share"] for r in rows}):
        own = [outcome(r) for r in rows if r["share"] == share]
        told = Counter(o["status"] for o in own)
        cells = [f"{sum(o[k] for o in own)}" for k in COLUMNS]
        statuses = ", ".join(f"{n} {s}" for s, n in told.most_common())
        print(f"| {share:g} | {len(own)} | {' | '.join(cells)} | {statuses} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--shares", nargs="*", type=float, default=[0.0, 0.05, 0.15, 0.3, 0.5, 1.0])
    parser.add_argument("--count", type=int, default=18, help="worlds a share")
    parser.add_argument("--seed", type=int, default=1000, help="first seed: 1000 development, 5000 test")
    parser.add_argument("--score", action="store_true", help="only print the table")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if not given.score:
        every = [list(worlds(s, given.count, given.seed)) for s in given.shares]
        for k in range(given.count):
            for share, own in zip(given.shares, every, strict=True):
                row = judged(given.out, share, *own[k])
                told = "+".join(f"{e['status']}:{e['mechanism']}" for e in row["verdict"]["effects"])
                words = share, row["kind"], row["remainder"], row["verdict"]["status"], told
                print(*words, f"{row['seconds']:.1f} s", flush=True)
    score(given.out)
