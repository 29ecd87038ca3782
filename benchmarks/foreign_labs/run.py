"""Hidden effects in thirty made-up labs' recordings: python run.py OUT [--labs d01 d12 ...].

Every data set is written as CSV with a mapping, goes through `tacdata import` and `tacdata discrepancy`, and is scored
against the hidden effects. The judge sees sessions alone.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from labs import LABS, SEED
from truth import outcome

HERE = Path(__file__).parent


def tacdata(engine, *words):
    """Run a verb; a status of 3 is an import that left trials out."""
    done = subprocess.run(
        [sys.executable, "-c", "from tacdata.cli import main; main()", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(engine), "OMP_NUM_THREADS": "1"},
    )
    if done.returncode not in (0, 3):
        raise SystemExit(f"tacdata {words[0]}: {done.stderr[-1500:] or done.stdout[-1500:]}")


def made(out, name, seed):
    """Return the folder of a data set, whose files are written if they are missing."""
    folder = out / f"{name}-{seed}"
    if not (folder / "files").exists():
        shutil.rmtree(folder, ignore_errors=True)
        LABS[name].write(folder / "unfinished", name, seed)
        (folder / "unfinished").rename(folder / "files")
    return folder


def judged(folder, engine):
    """Return the verdict on a data set, whose files are imported and judged if that is missing."""
    files, verdict = folder / "files", folder / "verdict"
    if not (folder / "seconds").exists():
        shutil.rmtree(verdict, ignore_errors=True)
        sessions = []
        for mapping in sorted(files.glob("mapping*.yaml")):
            sessions.append(folder / mapping.stem.replace("mapping", "session"))
            shutil.rmtree(sessions[-1], ignore_errors=True)
            tacdata(engine, "import", files, "--mapping", mapping, "--out", sessions[-1])
        begun = time.perf_counter()
        tacdata(engine, "discrepancy", *sessions, "--out", verdict)
        (folder / "seconds").write_text(f"{time.perf_counter() - begun:.1f}")
    return json.loads((verdict / "verdict.json").read_text())


def result(name, seed, verdict, seconds):
    """Return the outcome of a data set, as it is kept in result.json."""
    lab = LABS[name]
    effects = [{k: e[k] for k in ("mechanism", "effect", "status", "alternatives")} for e in verdict["effects"]]
    return {
        "version": "1.0",
        "name": name,
        "seed": seed,
        "hidden": lab.hidden,
        "truth": list(lab.truth.names),
        "best": lab.truth.best,
        "status": verdict["status"],
        "effects": effects,
        "outcome": outcome(verdict, lab.truth),
        "seconds": seconds,
    }


def row(found):
    """Return a line of the table."""
    told = [f"{e['status']}:" + "/".join([e["mechanism"], *e["alternatives"]]) for e in found["effects"]]
    truth = " + ".join(found["truth"]) or "nothing"
    verdict = f"{found['status']}: {' + '.join(told)}" if told else found["status"]
    return f"| {found['name']} | {truth} | {verdict} | {found['outcome']} | {found['seconds']:.0f} |"


def main(out, engine, names, seed):
    """Judge every data set that is not judged yet, and print a table."""
    counts = {}
    print("| data set | truth | verdict | outcome | s |\n|---|---|---|---|---|")
    for name in names:
        folder = made(out, name, seed)
        verdict = judged(folder, engine)
        found = result(name, seed, verdict, float((folder / "seconds").read_text()))
        (folder / "result.json").write_text(json.dumps(found, indent=1))
        counts[found["outcome"]] = counts.get(found["outcome"], 0) + 1
        print(row(found), flush=True)
    print(", ".join(f"{outcome} {count}" for outcome, count in sorted(counts.items())))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--engine", type=Path, default=HERE.parents[1], help="folder that holds the package")
    parser.add_argument("--labs", nargs="*", default=["d"], help="how the names of data sets begin")
    parser.add_argument("--seed", type=int, default=SEED, help="of the first lab; each has the next one")
    parser.add_argument("--list", action="store_true", help="say what is hidden in each, and do nothing")
    parser.add_argument("--only-make", action="store_true", help="write data sets, and judge none")
    given = parser.parse_args()
    chosen = [name for name in LABS if name.startswith(tuple(given.labs))]
    if given.list:
        for name in chosen:
            lab = LABS[name]
            truth = " + ".join(lab.truth.names) or "nothing"
            print(f"{name} ({truth}): {lab.hidden} At best {lab.truth.best}.")
    elif given.only_make:
        for name in chosen:
            print(made(given.out, name, given.seed))
    else:
        main(given.out, given.engine, chosen, given.seed)
