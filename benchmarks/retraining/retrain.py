"""Retrains the network that ships, on a card that is lent for minutes: solve, train variants side by side, score.

    python benchmarks/retraining/retrain.py solve WORK --out OUT --seconds 480
    python benchmarks/retraining/retrain.py train WORK --out OUT --seconds 330
    python benchmarks/retraining/retrain.py score WORK --out OUT --seconds 200
    python benchmarks/retraining/retrain.py final WORK --out OUT --seconds 300 --variants chosen

Each part ends at its time, keeps its results in WORK, and goes on with them when it is called again. OUT gets the
results: solved presses of the learning curve's benchmark, networks, scores.json, and times.json, which lists the time
of each part. On a machine without a card give --device cpu and few presses.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CURVE = HERE.parent / "learning_curve"
TRAINING = "pretraining"


@dataclass(frozen=True)
class SolvedSet:
    """Presses that are solved once."""

    name: str
    plan: Path
    presses: int
    seed: int
    after: float = 5.0
    """Time that is left for the following parts [s], on a card."""
    kept: bool = False
    """Whether its files go to OUT."""


_ROUNDS = 3
"""How often scores that failed are tried: a process that was killed takes the others of its pool along [count]."""
PLAN = HERE / "pretraining.yaml"
SETS = (
    SolvedSet("dev-presses", CURVE / "rig_presses.yaml", 300, 1),
    SolvedSet("dev-contacts", CURVE / "rig_contacts.yaml", 200, 1),
    SolvedSet(TRAINING, PLAN, 6144, 0, after=140),
    SolvedSet("presses", CURVE / "rig_presses.yaml", 560, 0, after=60, kept=True),
    SolvedSet("contacts", CURVE / "rig_contacts.yaml", 240, 0, after=60, kept=True),
    SolvedSet(TRAINING, PLAN, 12288, 0, after=60),
)
"""In the order in which they are solved. Training presses come in two lots. A lot takes one skin after the other, and
the first is to hold all of them."""


class Clock:
    """The time that a part has, and a file of the times that parts took."""

    def __init__(self, out: Path, part: str, seconds: float) -> None:
        """Start it."""
        self.until, self._file, self._part = time.time() + seconds, out / "times.json", part
        out.mkdir(parents=True, exist_ok=True)

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.until - time.time()

    def note(self, what: str, began: float, **more: Any) -> None:
        """Write down how long something took, and print it."""
        known = json.loads(self._file.read_text()) if self._file.exists() else []
        line = {"part": self._part, "what": what, "seconds": round(time.time() - began, 1), **more}
        self._file.write_text(json.dumps([*known, line], indent=1) + "\n")
        print(line, flush=True)


def solve(work: Path, out: Path, seconds: float, device: str, scale: float, workers: int) -> None:
    """Solve all sets, the training presses as many as there is time for; turn them into frames meanwhile."""
    clock = Clock(out, "solve", seconds)
    for one in SETS:
        began, count = time.time(), max(2, round(one.presses * scale))
        folder = work / "solved" / one.name
        limit = clock.left - (one.after if device != "cpu" else 5.0)
        if limit < 5:
            print(f"no time for {one.name}", flush=True)
            continue
        command = [
            sys.executable,
            "-m",
            "tacdata.cli",
            "simulate",
            str(one.plan),
            "--solved",
            str(folder),
            "--presses",
            str(count),
            "--seed",
            str(one.seed),
            "--device",
            device,
            "--workers",
            str(workers),
        ]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
        try:
            code = subprocess.run(command, env=environment, timeout=limit).returncode
        except subprocess.TimeoutExpired:
            code = "stopped at its time"
        clock.note(one.name, began, asked=count, ended=code, files=len(list(folder.glob("presses-*.npz"))))
        if one.kept and folder.exists():
            shutil.copytree(folder, out / f"solved-{one.name}", dirs_exist_ok=True)
    _pack(work, clock)


def _pack(work: Path, clock: Clock) -> None:
    import presses

    began = time.time()
    packed = presses.pack(work / "solved" / TRAINING, work / "packed", len(os.sched_getaffinity(0)))
    clock.note("pack", began, presses=packed)


def train(work: Path, out: Path, seconds: float, device: str, names: list[str], batch: int, start: str | None) -> None:
    """Train variants side by side, each in a process of its own, from random weights or from a network."""
    clock = Clock(out, "train", seconds)
    _pack(work, clock)
    began = time.time()
    context = multiprocessing.get_context("spawn")
    crew = {
        name: context.Process(target=_train_one, args=(name, work, out, clock.until, device, batch, start))
        for name in names
    }
    for process in crew.values():
        process.start()
    for name, process in crew.items():
        process.join(max(clock.left + 60, 1))
        if process.is_alive():
            process.terminate()  # its best epoch so far is kept, and taken below
            process.join()
        best = work / "runs" / name / "best.safetensors"
        if not (out / f"{name}.safetensors").exists() and best.exists():
            shutil.copyfile(best, out / f"{name}.safetensors")
        clock.note(f"train {name}", began, ended=process.exitcode)


def _train_one(name: str, work: Path, out: Path, until: float, device: str, batch: int, start: str | None) -> None:
    import variants

    from tacdata.training.pretraining.shipped import pretrained

    def shown(line: str) -> None:
        print(line, flush=True)

    variants.train_one(
        name,
        work / "solved" / TRAINING,
        work / "packed",
        work / "runs",
        out,
        until,
        device,
        batch,
        pretrained(start) if start else None,
        shown,
    )


def score(work: Path, out: Path, seconds: float, names: list[str], final: bool) -> None:
    """Score the networks in OUT and the one that ships: by default on rigs of other seeds than the benchmark's."""
    clock = Clock(out, "final" if final else "score", seconds)
    began, target = time.time(), out / ("final.json" if final else "scores.json")
    found: dict[str, dict[str, Any]] = json.loads(target.read_text()) if target.exists() else {}
    import score as scoring

    networks = {name: out / f"{name}.safetensors" for name in names if (out / f"{name}.safetensors").exists()}
    starts = {"shipped": "shipped"} | {name: str(path) for name, path in networks.items()}
    own, contacts = (work / "solved" / (name if final else f"dev-{name}") for name in ("presses", "contacts"))
    rigs, counts = ((0, 1, 2), (3, 10, 30, 100)) if final else (scoring.RIGS, (scoring.PRESSES,))
    wearers = (0, range(100, 112)) if final else (scoring.RIGS[0], scoring.WEARERS)
    fits = work / ("final" if final else "fits")
    jobs: dict[tuple[str, str], tuple[Any, ...]] = {}
    for name, start in starts.items():
        jobs[name, "forces"] = (scoring.on_forces, start, own, contacts)
        jobs[name, "worn"] = (scoring.worn, start, own, fits / f"{name}-worn", *wearers)
        for rig in rigs:
            jobs[name, f"rig {rig}"] = (scoring.on_rig, start, own, contacts, rig, fits / f"{name}-{rig}", counts)
    waiting = {key: job for key, job in jobs.items() if key[1] not in found.get(key[0], {})}
    for _ in range(_ROUNDS):
        _run(waiting, found, target, clock)
        waiting = {key: job for key, job in waiting.items() if key[1] not in found.get(key[0], {})}
        if not waiting or clock.left < 5:
            break
    clock.note("score", began, jobs=len(waiting))
    table(found)


def _in_words(function: Any, *given: Any) -> Any:
    """Call a function; exceptions become texts, as not every one survives the way between processes."""
    try:
        return function(*given)
    except Exception:
        raise RuntimeError(traceback.format_exc()) from None


def _run(
    jobs: dict[tuple[str, str], tuple[Any, ...]], found: dict[str, dict[str, Any]], target: Path, clock: Clock
) -> None:
    """Run jobs side by side until the time is over, and write down each result as it comes."""
    # Not "with": a pool that is left waits for its last job, and the time may be over.
    pool = ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=multiprocessing.get_context("spawn"))
    tasks = {pool.submit(_in_words, *job): key for key, job in jobs.items()}
    try:
        for task in as_completed(tasks, timeout=max(clock.left, 1)):
            name, part = tasks[task]
            if error := task.exception():
                print(name, part, repr(error), flush=True)
                continue
            found.setdefault(name, {})[part] = task.result()
            target.write_text(json.dumps(found, indent=1) + "\n")
            print(f"{clock.left:.0f} s left", name, part, found[name][part], flush=True)
    except TimeoutError:
        print("no time for the rest; called again, it goes on", flush=True)
    for process in (pool._processes or {}).values():
        process.terminate()
    pool.shutdown(wait=False, cancel_futures=True)


def chosen(found: dict[str, dict[str, Any]]) -> str:
    """Return the network that finds most pairs and has the best ridges, of those that lose nothing on single presses.

    Lost is an overlap of 0.01 or a centroid of 0.03 px against the network that ships.
    """

    def on_rigs(name: str, what: str, kind: str) -> float:
        rigs = [value[what] for part, value in found[name].items() if part.startswith("rig")]
        return sum(rig[kind] for rig in rigs) / max(len(rigs), 1)

    def gain(name: str) -> float:
        rigs = [value["contacts"] for part, value in found[name].items() if part.startswith("rig")]
        pairs = [rig[kind]["all_found"] for rig in rigs for kind in ("balls_4mm", "unlike_4mm")]
        return sum(pairs) / max(len(pairs), 1) + found[name]["worn"]["aligned_iou"]

    known = set(found.get("shipped", ()))
    scored = "worn" in known and any(part.startswith("rig") for part in known)
    whole = [name for name, parts in found.items() if scored and name != "shipped" and known <= set(parts)]
    if not whole:
        raise SystemExit("no network has all its scores yet: call score again, or name one by --variants")
    kept = [
        name
        for name in whole
        if on_rigs(name, "held out", "iou_deep") > on_rigs("shipped", "held out", "iou_deep") - 0.01
        and on_rigs(name, "held out", "centroid") < on_rigs("shipped", "held out", "centroid") + 0.03
    ]
    return max(kept or whole, key=gain)


def table(found: dict[str, dict[str, Any]]) -> None:
    """Print a line a network: means over the rigs."""
    print("network, pairs 4 mm found (forces, rigs), prism (forces, worn), held out px, IoU; edge IoU, unseen IoU")
    for name, parts in found.items():
        rigs = [value for part, value in parts.items() if part.startswith("rig")]

        def mean(*keys: str, rigs: list[dict[str, Any]] = rigs) -> float:
            values = []
            for value in rigs:
                for key in keys:
                    value = value.get(key, {}) if isinstance(value, dict) else {}
                if isinstance(value, float):
                    values.append(value)
            return round(sum(values) / len(values), 3) if values else float("nan")

        forces = parts.get("forces", {})
        pairs = [forces.get("contacts", {}).get(kind, {}).get("all_found") for kind in ("balls_4mm", "unlike_4mm")]
        print(
            name,
            pairs,
            [mean("contacts", kind, "all_found") for kind in ("balls_4mm", "unlike_4mm")],
            forces.get("prism, aligned IoU"),
            parts.get("worn", {}).get("aligned_iou"),
            mean("held out", "centroid"),
            mean("held out", "iou_deep"),
            mean("edge", "iou_mean"),
            mean("unseen shapes", "iou_mean"),
            flush=True,
        )


def main() -> None:
    """Run one part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=("solve", "train", "score", "final"))
    parser.add_argument("work", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=480.0, help="time that it has")
    parser.add_argument("--device", default="cuda", help="cuda or cpu")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the presses to solve, for a trial")
    parser.add_argument("--workers", type=int, default=1, help="processes that solve")
    parser.add_argument("--variants", default="broad,narrow")
    parser.add_argument("--from", dest="start", help="train on from this checkpoint, or from `shipped`")
    parser.add_argument("--batch-size", type=int, default=1024)
    given = parser.parse_args()
    sys.path[:0] = [str(HERE), str(CURVE)]
    names = given.variants.split(",")
    if given.part == "final" and names == ["chosen"]:
        names = [chosen(json.loads((given.out / "scores.json").read_text()))]
        print("chosen on other rigs:", *names, flush=True)
    if given.part == "solve":
        solve(given.work, given.out, given.seconds, given.device, given.scale, given.workers)
    elif given.part == "train":
        train(given.work, given.out, given.seconds, given.device, names, given.batch_size, given.start)
    else:
        score(given.work, given.out, given.seconds, names, given.part == "final")


if __name__ == "__main__":
    main()
