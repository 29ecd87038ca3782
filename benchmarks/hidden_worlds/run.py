"""Make worlds and have them judged: python run.py OUT BLOCK... [--help]. Goes on where it was stopped."""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from worlds import written
from worlds.cases import BLOCKS, DEVELOPMENT, cases
from worlds.physics import KNOWN

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
ROOMS = ("chain", "effects", "discrepancy")
"""Packages of the engine."""
LONGEST = 300
"""A judge that takes longer is stopped, and scored as crashed [s]."""


def engine_of(root, rooms=ROOMS):
    """Return the identity of an engine: the hash of its packages' files, and their commit."""
    digest = hashlib.sha256()
    for path in sorted(p for room in rooms for p in (root / "tacdata" / room).rglob("*")):
        if path.suffix in (".py", ".yaml", ".json"):
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=False)
    return {"hash": digest.hexdigest()[:16], "commit": head.stdout.strip()[:12] or None}


def judged(world, root, options):
    """Have one world judged by a process that sees nothing else; return its answer and its model's prediction."""
    with tempfile.TemporaryDirectory(prefix="judge-") as name:
        folder = Path(name)
        for path in world.iterdir():
            shutil.copy(path, folder / path.name)
        if not (folder / "table.npz").exists():
            shutil.copy(world.parent / written.TABLE, folder / "table.npz")
        kept = {k: v for k, v in os.environ.items() if k in ("PATH", "HOME", "TMPDIR", "LANG")}
        command = [sys.executable, str(HERE / "judge.py"), str(folder), json.dumps(options)]
        try:
            done = subprocess.run(
                command,
                cwd=folder,
                env={**kept, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"},
                capture_output=True,
                text=True,
                timeout=LONGEST,
                check=False,
            )
            error = done.stderr[-2000:] if done.returncode else ""
        except subprocess.TimeoutExpired:
            error = f"stopped after {LONGEST} s"
        if error:
            return {"verdict": None, "seconds": None, "error": error}, None
        said = folder / "said.npz"
        return json.loads((folder / "verdict.json").read_text()), said.read_bytes() if said.exists() else None


def wanted(arguments):
    """Return the cases of this shard."""
    first, of = (int(n) for n in arguments.shard.split("/"))
    every = [c for b in arguments.blocks for r in range(arguments.repeats) for c in cases(b, arguments.seed, r)]
    every = [c for c in every if not arguments.name or any(n in c.name for n in arguments.name)]
    # The order by identity is as good as random, so that the first worlds of a run are a sample of all blocks.
    every = sorted(every, key=lambda c: c.identity)
    return [c for k, c in enumerate(every) if k % of == first][: arguments.most]


def main(arguments):
    """Judge the worlds without a verdict."""
    out, kept = arguments.out, arguments.out / "verdicts" / arguments.label
    kept.mkdir(parents=True, exist_ok=True)
    options = json.loads(arguments.options)
    if arguments.method != "workflow":
        options["method"] = arguments.method
    for case in wanted(arguments):
        path = kept / f"{case.identity}.json"
        if path.exists():
            continue
        written.write(out, case)
        more = {"without": [n for e in case.effects for n in KNOWN[e].called]} if arguments.without_truth else {}
        engine = engine_of(arguments.engine)
        answer, said = judged(out / "worlds" / case.identity, arguments.engine, {**options, **more})
        if said is not None:
            path.with_suffix(".npz").write_bytes(said)
        answer = {"version": "1.0", "id": case.identity, "engine": engine, "options": {**options, **more}, **answer}
        path.write_text(json.dumps(answer))
        if arguments.show:
            print(case.block, case.name, case.response, line(answer), flush=True)
        else:
            print(case.identity, line(answer), flush=True)


def line(answer):
    """Return an answer in a line."""
    verdict = answer["verdict"]
    if verdict is None:
        return f"crashed: {answer['error'].strip().splitlines()[-1:]}"
    told = ["/".join([e["mechanism"], *e["alternatives"]]) for e in verdict["effects"]]
    return f"{verdict['status']} {' + '.join(told)} {answer['seconds']:.0f} s"


def chosen(words=None):
    """Return the arguments of the command line, or those given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("blocks", nargs="+", choices=[*BLOCKS, "all"])
    parser.add_argument("--shard", default="0/1", help="K/N: the K-th of N parts, from 0")
    parser.add_argument("--seed", type=int, default=DEVELOPMENT, help="first seed: 1000 development, 5000 test")
    parser.add_argument("--repeats", type=int, default=1, help="worlds a case, each with a seed of its own")
    parser.add_argument("--most", type=int, default=None, help="stop after so many worlds of this shard")
    parser.add_argument("--name", nargs="*", default=[], help="only cases whose names hold one of these")
    parser.add_argument("--label", default="workflow", help="folder of the verdicts below OUT/verdicts")
    parser.add_argument("--method", default="workflow", help="workflow, or a baseline")
    parser.add_argument("--options", default="{}", help="JSON: options of the judge")
    parser.add_argument("--without-truth", action="store_true", help="take what is true out of the library")
    parser.add_argument("--engine", type=Path, default=REPOSITORY, help="folder that holds the package to judge with")
    parser.add_argument("--show", action="store_true", help="print what was hidden beside what was found")
    found = parser.parse_args(words)
    found.blocks = list(BLOCKS) if "all" in found.blocks else found.blocks
    return found


if __name__ == "__main__":
    main(chosen())
