"""Stand-ins for real recordings of several kinds: python run.py OUT [--kinds ...] [--help].

Each set is written as CSV with a mapping and goes through `tacdata import` and the verdict. Sets that are judged are
not judged again. `--score` prints the tables alone.
"""

import argparse
import json
import os
import random
import shutil
import sys
import time
from collections import Counter
from multiprocessing import TimeoutError
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from kinds import FRICTION, KINDS, MEMORY  # noqa: E402
from workers import pool  # noqa: E402
from written import REMAINDERS, write  # noqa: E402

SHARES = (0.05, 0.15, 0.3, 0.5)
LOOPS = ("real loop",)
"""Remainders that are a loop of a real skin: its family is fair, too."""


def sets(kinds, shares, count, seed):
    """Yield name, share, remainder and seed of sets; each kind meets each remainder in turn."""
    for k in range(count):
        for at, name in enumerate(kinds):
            for turn, share in enumerate(shares):
                which = tuple(REMAINDERS)[(k + at + turn) % len(REMAINDERS)] if share else ""
                yield name, share, which, seed + k


def judged(out, engine, name, share, which, seed):
    """Judge one set; return its row."""
    path = out / f"{name}-{share:g}-{which}-{seed}.json".replace(" ", "_").replace(",", "")
    if path.exists():
        return json.loads(path.read_text())
    if engine is not None:
        sys.path.insert(0, str(engine))
    from tacdata.discrepancy.data.recordings import course_of
    from tacdata.discrepancy.judge import judge
    from tacdata.discrepancy.model.spec import read_spec
    from tacdata.importing.imported_session import import_session

    folder = path.with_suffix("")
    shutil.rmtree(folder, ignore_errors=True)
    write(folder / "files", name, share, which, seed)
    truth = json.loads((folder / "files" / "truth.json").read_text())
    (folder / "files" / "truth.json").unlink()
    row = {"kind": name, "share": share, "remainder": which, "seed": seed, **truth, "error": ""}
    begun = time.process_time()
    try:
        import_session(folder / "files", folder / "files" / "mapping.yaml", folder / "session")
        verdict = judge(course_of([folder / "session"]), read_spec(None)).document
    except Exception as error:
        verdict, row["error"] = {"status": "error", "effects": []}, f"{type(error).__name__}: {error}"
    row |= {"seconds": time.process_time() - begun, "verdict": verdict}
    path.write_text(json.dumps(row))
    shutil.rmtree(folder, ignore_errors=True)
    return row


def outcome(row):
    """Return whether a verdict fits the true effects."""
    kind, alone = KINDS[row["kind"]], row["share"] == 1
    mechanisms = set() if alone else set(kind.mechanisms)
    families = set() if alone else set(kind.families)
    fair = families | ({MEMORY, FRICTION} if row["remainder"] in LOOPS else set())
    effects = row["verdict"]["effects"]
    named = [e for e in effects if e["status"] == "named" and e.get("level", "form")]
    named += [e for e in effects if e["status"] == "ambiguous" and e.get("level") == "family"]  # a set of one family
    sets = [{e["mechanism"], *e["alternatives"]} for e in effects if e["status"] in ("named", "ambiguous")]
    wrong = [e for e in named if e["family"] not in fair]
    wrong += [
        e
        for e in named
        if e.get("level") != "family"
        and e["mechanism"] not in mechanisms
        and (row["remainder"] not in LOOPS or e["family"] in families)
        and e not in wrong
    ]
    told = {
        e["family"] for e in (*named, *(e for e in effects if e["status"] == "ambiguous" and not e["alternatives"]))
    }
    return {
        "family": bool(told & families),
        "mechanism": any(s & mechanisms and len(s) <= 2 for s in sets)
        and any(e["mechanism"] in mechanisms or set(e["alternatives"]) & mechanisms for e in effects),
        "wrong": bool(wrong),
        "suspected": any({e["mechanism"], *e["alternatives"]} & mechanisms for e in effects),
    }


def line(row):
    """Return a verdict in a line."""
    said = [
        f"{e['status']} {e.get('level') or ''}:{'/'.join([e['mechanism'], *e['alternatives']])}"
        for e in row["verdict"]["effects"]
    ]
    good = [k for k, v in outcome(row).items() if v]
    return (
        f"{row['kind']:26s}{row['share']:5g} {row['remainder']:13s}{row['verdict']['status']:18s} {' + '.join(said)} "
        f"[{' '.join(good)}] {row['seconds']:.0f} s {row['error'][:200]}"
    )


def score(rows):
    """Print how often names were right, by kind and by share."""
    for key in ("kind", "share"):
        print(f"\n| {key} | sets | family | mechanism or a pair | wrong | suspected | statuses |")
        print("|---|---:|---:|---:|---:|---:|---|")
        for value in dict.fromkeys(r[key] for r in rows):
            own = [r for r in rows if r[key] == value and (key == "kind" or KINDS[r["kind"]].mechanisms)]
            found = [outcome(r) for r in own]
            cells = [str(sum(f[k] for f in found)) for k in ("family", "mechanism", "wrong", "suspected")]
            told = Counter(r["verdict"]["status"] for r in own)
            print(f"| {value} | {len(own)} | {' | '.join(cells)} | {', '.join(f'{n} {s}' for s, n in told.items())} |")
    real = [r for r in rows if KINDS[r["kind"]].mechanisms and r["share"] < 1]
    found = [outcome(r) for r in real]
    counts = {k: sum(f[k] for f in found) for k in ("family", "mechanism", "wrong", "suspected")}
    print(f"\nof {len(real)} that hold an effect: {counts}")


def _one(words):
    return judged(*words)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--shares", nargs="*", type=float, default=SHARES)
    parser.add_argument("--count", type=int, default=1, help="sets of each kind and share")
    parser.add_argument("--seed", type=int, default=1000, help="first seed: 1000 development, 5000 test")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--engine", type=Path, default=None, help="folder that holds the package to judge with")
    parser.add_argument("--limit", type=float, default=1e6, help="stop after so many seconds")
    parser.add_argument("--score", action="store_true", help="only print the tables")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if not given.score:
        begun, tasks = time.monotonic(), list(sets(given.kinds, given.shares, given.count, given.seed))
        random.Random(given.seed).shuffle(tasks)  # the first sets of a run that is stopped are a sample of all
        words = [(given.out, given.engine, *one) for one in tasks]
        with pool(given.workers) as running:
            rows = running.imap_unordered(_one, words)
            try:
                while True:
                    print(line(rows.next(timeout=max(given.limit - (time.monotonic() - begun), 0.0))), flush=True)
            except (StopIteration, TimeoutError):
                running.terminate()
    score([json.loads(p.read_text()) for p in sorted(given.out.glob("*.json"))])
