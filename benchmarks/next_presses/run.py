"""How many presses settle an ambiguous verdict, recommended or random: python run.py OUT [--help].

A line of OUT/worlds.jsonl for each world; worlds that have one are not done again. The workflow's answers are kept
in OUT/asked, so that a run that was stopped in a world goes on there. `--score` prints the figures alone.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
sys.path[:0] = [str(HERE.parent / "hidden_worlds"), str(HERE)]

from presses import alike, length, recordings  # noqa: E402
from run import ROOMS, engine_of  # noqa: E402  (hidden_worlds comes first on the path)
from scoring.measures import interval  # noqa: E402
from scoring.outcome import claims, holds  # noqa: E402
from worlds import protocol, skin, world  # noqa: E402
from worlds.cases import cases, inseparable  # noqa: E402
from worlds.physics import KNOWN  # noqa: E402

ENGINE = (*ROOMS, "revision")
"""Packages that judge and recommend."""
STEADY = (
    "latency",
    "low_pass_filter",
    "servo_lag",
    "backlash",
    "hysteresis",
    "relaxation",
    "creep",
    "poroelasticity",
    "nonlinear_relaxation",
    "baseline_tracking",
    "softening",
    "frame_compliance",
    "stiffening",
    "saturation",
    "gap_curvature",
    "xy_offset",
    "tilt",
)
"""Effects that do not depend on how long the session is: presses added change nothing of those before.

Each in the library's own form: an effect between two names is settled by no press.
"""
SIZES = (1.0, 4.0)
"""Sizes of effects, in those of the aliases, which are a few micrometres and milliseconds."""
EPISODES = 24
"""Presses of a world at first."""
STEPS = (4, 12)
"""Numbers of recommended presses after which the workflow is asked again: one turn of a plan, and all of it."""
TIMES = (1, 3)
"""Numbers of random presses after which it is, over the number of recommended ones that settled it."""


def wanted(seed):
    """Yield worlds that their presses leave open, and that other presses at their places tell from any rival."""
    found = [c for c in cases("aliases", seed) if c.settings.get("protocol", "rich") not in ("rich", "one_site")]
    for case in sorted(found, key=lambda c: c.identity):
        [(name, size)], [times] = case.effects.items(), case.times.values()
        if case.name.rsplit("-", 1)[0] in STEADY and not inseparable(name, case.response, times):
            case.settings["episodes"] = EPISODES
            for many in SIZES:
                if many * size <= KNOWN[name].most:
                    yield replace(
                        case, name=f"{case.name} x {many:g}", effects={name: many * size}, times={name: many * times}
                    )


def asked(case, more, table, count):
    """Ask the workflow about a world with further presses, once; return verdict, recommended presses, CPU seconds."""
    words = json.dumps([case.identity, engine_of(REPOSITORY, ENGINE)["hash"], more, count])
    kept = table.parent / "asked" / f"{hashlib.sha256(words.encode()).hexdigest()[:16]}.json"
    if not kept.exists():
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(json.dumps(answered(case, more, table, count)))
    return json.loads(kept.read_text())


def answered(case, more, table, count):
    """Have the workflow judge a world in a process that sees nothing else."""
    with tempfile.TemporaryDirectory(prefix="ask-") as name:
        folder = Path(name)
        np.savez(folder / "recordings.npz", **recordings(case, more))
        (folder / "task.json").write_text(json.dumps({"version": "1.0", "response": case.response}))
        (folder / "table.npz").symlink_to(table)
        kept = {k: v for k, v in os.environ.items() if k in ("PATH", "HOME", "TMPDIR", "LANG")}
        subprocess.run(
            [sys.executable, str(HERE / "ask.py"), str(folder), str(count)],
            cwd=folder,
            check=True,
            env={**kept, "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
        )
        told, following = json.loads((folder / "verdict.json").read_text()), folder / "next.json"
        return told["verdict"], json.loads(following.read_text()) if following.exists() else [], told["seconds"]


def settled(case, verdict):
    """Return the names that a settled verdict gives, and whether all are right; None without names."""
    given = [c for c in claims(verdict) if c[0] is not None]
    if not given or not verdict["status"].startswith("named"):
        return None
    return {"names": [m for m, _ in given], "right": all(any(holds(c, h) for h in case.effects) for c in given)}


def by_recommendation(case, following, table):
    """Add recommended presses, each time those of the last verdict, until one settles it; return the record."""
    more, done, plan = [], [], list(following)
    for count in STEPS:
        # A plan of fewer presses is recorded again from its beginning.
        more += [plan[k % len(plan)] for k in range(count - len(more))]
        verdict, following, _ = asked(case, more, table, STEPS[-1])
        done.append({"presses": count, "status": verdict["status"], "told": told(verdict)})
        if found := settled(case, verdict):
            return more, done, found
        plan = list(following) or plan
    return more, done, None


def by_chance(case, like, settle, table):
    """Add random presses as long as recommended ones until a verdict settles it; return the number, and the record."""
    rng, done, more = np.random.default_rng([case.seed, 21]), [], []
    before = protocol.KNOWN[case.settings["protocol"]](np.random.default_rng([case.seed, 11]), EPISODES)
    counts = [t * settle for t in TIMES] if settle else [STEPS[-1]]
    for count in counts:
        while len(more) < count:
            more.append(alike(rng, like[len(more) % len(like)], before))
        verdict, _, _ = asked(case, more, table, 0)
        done.append({"presses": count, "status": verdict["status"], "told": told(verdict)})
        if found := settled(case, verdict):
            return count, done, found
    return counts[-1], done, None


def told(verdict):
    """Return a verdict's effects in short."""
    return [[e["mechanism"], *e["alternatives"]] for e in verdict["effects"]]


def line(case, table):
    """Return the record of one world; None of its counts where its first verdict is not ambiguous."""
    verdict, following, _ = asked(case, [], table, STEPS[-1])
    row = {
        "id": case.identity,
        "name": case.name,
        "response": case.response,
        "seed": case.seed,
        "engine": engine_of(REPOSITORY, ENGINE),
        "first": {"status": verdict["status"], "told": told(verdict)},
        "recommended": [[round(p["depth"], 2), p["speed"], p["hold"], p["purpose"]] for p in following[:4]],
    }
    if verdict["status"] != "ambiguous" or not following:
        return row | {"open": verdict["status"] == "ambiguous", "asked": False}
    more, own, found = by_recommendation(case, following, table)
    count = own[-1]["presses"] if found else None
    like = more or following
    chance, others, other = by_chance(case, like, count, table)
    return row | {
        "asked": True,
        "own": own,
        "settled": found,
        "presses": count,
        "random": others,
        "random_settled": other,
        "random_presses": chance,
        "seconds": sum(length(p) for p in like[: count or len(like)]),
    }


def names_left(stage):
    """Return how many names a verdict leaves."""
    return len({name for names in stage["told"] for name in names})


def score(rows):
    """Print how many times fewer presses settle a world by recommendation."""
    done = [r for r in rows if r["asked"]]
    print(f"{len(rows)} worlds, {len(done)} ambiguous with a recommendation")
    for r in done:
        by = r["presses"] or f"not by {STEPS[-1]}"
        names, others = (r[k] and (r[k]["names"], r[k]["right"]) for k in ("settled", "random_settled"))
        rest = "" if others else "not by "
        print(f"  {r['name']:32s}{r['response']:8s} own {by} {names}; random {rest}{r['random_presses']} {others}")
    left = np.array([(names_left(r["own"][-1]), names_left(r["random"][0])) for r in done])
    if len(done):
        print(f"names left after as many presses: {left[:, 0].mean():.1f} recommended, {left[:, 1].mean():.1f} random")
    own = [r for r in done if r["presses"]]
    chance = sum(bool(r["random_settled"]) for r in done)
    print(f"settled by recommendation: {len(own)} of {len(done)}; by random presses {chance}")
    if not own:
        return
    ratio = np.log([r["random_presses"] / r["presses"] for r in own])
    drawn = np.random.default_rng(1).integers(len(ratio), size=(2000, len(ratio)))
    low, high = np.exp(np.percentile(ratio[drawn].mean(axis=1), [2.5, 97.5]))
    thrice = sum(r["random_presses"] >= 3 * r["presses"] for r in own)
    below, above = interval(thrice, len(done))
    print(f"right of those: {sum(r['settled']['right'] for r in own)}")
    print(f"random over recommended, geometric mean: at least {np.exp(ratio.mean()):.1f} ({low:.1f} to {high:.1f})")
    print(f"at least 3 times fewer: {thrice} of {len(done)} ({100 * below:.0f} to {100 * above:.0f} %)")


def main(given):
    """Judge the worlds without a record."""
    given.out.mkdir(parents=True, exist_ok=True)
    path, table = given.out / "worlds.jsonl", (given.out / "nominal.npz").resolve()
    rows = [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []
    if not given.score:
        if not table.exists():
            skin.write_table(table, world.RADII)
        there = {r["id"] for r in rows}
        for case in (c for k in range(given.repeats) for c in wanted(given.seed + k)):
            if case.identity not in there and sum(r["asked"] for r in rows) < given.most:
                rows.append(line(case, table))
                with path.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
                print(json.dumps(rows[-1]), flush=True)
    score(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=1000, help="first seed: 1000 development, 5000 test")
    parser.add_argument("--repeats", type=int, default=1, help="worlds a case, each with a seed of its own")
    parser.add_argument("--most", type=int, default=1000, help="stop after so many worlds whose verdict is ambiguous")
    parser.add_argument("--score", action="store_true", help="only print the figures")
    main(parser.parse_args())
