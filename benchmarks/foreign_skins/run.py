"""Hidden effects in foreign sensors, as files of another lab: python run.py OUT [--effects ...] [--skins ...].

Every world is written as CSV with a mapping, goes through `tacdata import` and `tacdata discrepancy`, and is scored:
the name that was put in, other names, sets. The judge sees the session's folder alone.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from hidden import EFFECTS, Rig
from protocols import PROTOCOLS, STEP
from skins import SKINS

HERE = Path(__file__).parent
NOISE, GAIN, WANDER, TOUCH, ENCODER = 0.003, 0.01, 0.002, 0.008, 0.0005
"""Noise of a reading, an episode's own gain, steps of offsets [largest rise]; errors of contact, of a position [mm]."""


def written(folder, skin_name, protocol, effect_name, size, seed):
    """Write one world's files and mapping."""
    rng = np.random.default_rng([seed, *map(ord, skin_name + protocol + effect_name)])
    skin, trials, effect = SKINS[skin_name], PROTOCOLS[protocol](rng), EFFECTS[effect_name]
    deepest = max(float(t.depth.max()) for t in trials)
    sites = max(t.site for t in trials) + 1
    loads = skin.laws(rng, sites)
    rig = Rig(size, trials[-1].begin + len(trials[-1].depth) * STEP)
    place = 5.0 * np.stack(np.divmod(np.arange(sites), 2), axis=1)
    wander = np.zeros(skin.channels)
    gauge = effect_name == "compliance"
    folder.mkdir(parents=True)
    for k, trial in enumerate(trials):
        tip = effect.moved(rig, trial, trial.depth)
        load = effect.loaded(rig, trial, tip, loads(trial.site, tip + rng.normal(0, TOUCH), deepest))
        clean = effect.read(rig, trial, load)
        at = np.cumsum(rng.normal(1 / skin.rate, 0.03 / skin.rate, int(len(tip) * STEP * skin.rate) - 2)) / STEP
        rows = np.clip(at.astype(int), 0, len(tip) - 1)
        wander = wander + rng.normal(0, WANDER, skin.channels)
        noise = rng.normal(0, NOISE, (len(rows), skin.channels))
        for i in range(1, len(noise)):
            noise[i] += 0.4 * noise[i - 1]
        clean = np.stack([np.interp(at, np.arange(len(clean)), c) for c in clean.T], axis=1)  # at, not before it
        said = clean * (1 + rng.normal(0, GAIN)) + wander + noise
        said = np.round(said / skin.levels)
        force = 8.0 * loads(trial.site, tip, deepest)[rows].clip(0).sum(axis=1) + rng.normal(0, 0.01, len(rows))
        depth = np.interp(at, np.arange(len(tip)), trial.depth)
        depth = np.round(depth + rng.normal(0, ENCODER, len(depth)), 3)
        parts = [trial.begin + at * STEP, *(np.full(len(rows), value) for value in place[trial.site]), depth]
        head = ["time_s", "x_mm", "y_mm", "depth_mm"]
        if gauge:
            parts += [np.round(tip[rows] + rng.normal(0, 0.002, len(rows)), 4), force]
            head += ["laser_mm", "force_N"]
        head += [f"ch{c}" for c in range(skin.channels)]
        np.savetxt(
            folder / f"trial_{k:03d}.csv",
            np.column_stack([*parts, said]),
            delimiter=",",
            fmt="%.5f",
            header=",".join(head),
            comments="",
        )
    mapping = {
        "version": "1.0",
        "name": skin_name,
        "sensor": {"name": skin_name.replace(" ", "_")},
        "files": {"all": {"path": "trial_{trial}.csv", "time": {"column": "time_s", "unit": "s", "zero": "shared"}}},
        "taxels": {"file": "all", "columns": "ch*", "unit": "counts"},
        "position": {
            "file": "all",
            "x": {"column": "x_mm", "unit": "mm"},
            "y": {"column": "y_mm", "unit": "mm"},
            "depth": {"column": "depth_mm", "unit": "mm"},
        },
    }
    if gauge:
        mapping["measured"] = {
            "laser": {"file": "all", "columns": ["laser_mm"], "unit": "mm"},
            "force": {"file": "all", "columns": ["force_N"], "unit": "N"},
        }
    (folder / "mapping.yaml").write_text(json.dumps(mapping))  # JSON is YAML


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
        raise SystemExit(done.stderr[-1500:] or done.stdout[-1500:])


def outcome(verdict, called):
    """Return success, set, unknown, missed or wrong."""
    sets = [{e["mechanism"], *e["alternatives"]} for e in verdict["effects"]]
    sure = verdict["status"] != "unknown"
    certain = {e["mechanism"] for e in verdict["effects"] if e["status"] == "named" and sure}
    if certain - set(called):
        return "wrong"
    if not called:
        return "right" if verdict["status"] == "none" else "doubt"
    if certain:
        return "right"
    if any(s & set(called) for s in sets):
        return "set with it"
    return {"none": "missed", "unknown": "unknown"}.get(verdict["status"], "set without it")


def main(out, engine, skins, protocols, effects, size, seed):
    """Judge every world that is not judged yet, and print a table."""
    counts = {}
    for effect in effects:
        for skin in skins:
            for protocol in protocols:
                folder = out / f"{effect}-{skin}-{protocol}-{size:g}-{seed}".replace(" ", "_")
                if not (folder / "verdict" / "verdict.json").exists():
                    shutil.rmtree(folder, ignore_errors=True)
                    written(folder / "files", skin, protocol, effect, size, seed)
                    tacdata(
                        engine,
                        "import",
                        folder / "files",
                        "--mapping",
                        folder / "files" / "mapping.yaml",
                        "--out",
                        folder / "session",
                    )
                    begun = time.perf_counter()
                    tacdata(engine, "discrepancy", folder / "session", "--out", folder / "verdict")
                    (folder / "seconds").write_text(f"{time.perf_counter() - begun:.1f}")
                verdict = json.loads((folder / "verdict" / "verdict.json").read_text())
                result = outcome(verdict, EFFECTS[effect].called)
                counts[result] = counts.get(result, 0) + 1
                told = " + ".join(
                    f"{e['status']}:" + "/".join([e["mechanism"], *e["alternatives"]]) for e in verdict["effects"]
                )
                seconds = (folder / "seconds").read_text()
                row = [effect, skin, protocol, result, f"{verdict['status']}: {told}", seconds]
                print(f"| {' | '.join(row)} |", flush=True)
    print(counts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--engine", type=Path, default=HERE.parents[1])
    parser.add_argument("--skins", nargs="*", default=list(SKINS))
    parser.add_argument("--protocols", nargs="*", default=list(PROTOCOLS))
    parser.add_argument("--effects", nargs="*", default=list(EFFECTS))
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    main(given.out, given.engine, given.skins, given.protocols, given.effects, given.size, given.seed)
