"""Make the datasets on which the paper's evaluation is recreated: three kinds of sessions on virtual rigs, labelled.

    python benchmarks/training_data.py OUT [--presses 216] [--speed 8] [--device cpu] [--stage record|label|pack]

| dataset | session | purpose |
|---|---|---|
| `main` | 216 presses, nine shapes, random sites, depths and speeds, specimen 1 | to learn from, and all splits |
| `evaluation` | the shipped evaluation plan, specimen 1, held out | 78 depth and 40 position trials |
| `wearing` | 57 presses with a prism on twelve specimens | centroid-aligned IoU per participant |

A specimen is a virtual rig with a seed of its own: other gains, stiffness and noise, and put down again; it has the
name of a sensor file of its own. Presses of the same configuration share one label. Existing files are not made again.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

import yaml

from tacdata import stages
from tacdata.errors import DeviceError, SolveError

SHAPES = ("sphere_2", "sphere_4", "punch", "pin", "ellipsoid", "square", "ring", "cone", "prism")
WEARERS, WEARING_TRIALS = 12, 57
ATTEMPTS = 5
"""How often a session is begun again after its rig was lost."""
WEARING_SEED = 101
"""Seed of the first wearer's world."""


def sensor_file(folder: Path, name: str) -> Path:
    """Write the default sensor under another name: a specimen of the same design."""
    from tacdata.sensor import default_sensor

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump({**default_sensor().document, "name": name}, sort_keys=False))
    return path


def wearing_plan(path: Path, trials: int) -> Path:
    """Write a plan of ``trials`` presses with the prism's edge."""
    from tacdata.plans.shipped.shipped_plan import MOTION
    from tacdata.plans.specimens import specimens

    recipe = {
        "version": "1.0",
        "name": "wearing",
        "indenters": specimens(("prism",)),
        "motion": {**MOTION, "hold": 0.7},
        "blocks": [
            {
                "indenter": "prism",
                "at": {"kind": "center"},
                "depths": [0.9],
                "repeats": trials,
                "purpose": "wearing trial",
            }
        ],
    }
    path.write_text(yaml.safe_dump(recipe, sort_keys=False))
    return path


def record(folder: Path, seed: int, sessions: dict[Path, Path], speed: float, specimen: str) -> None:
    """Record each plan (session -> plan) that is not recorded yet; a rig that was lost is started again."""
    for attempt in range(1, ATTEMPTS + 1):
        open_ones = {session: plan for session, plan in sessions.items() if not (session / "finished").exists()}
        if not open_ones:
            return
        try:
            _record(folder, seed, open_ones, speed, specimen)
        except (stages.StageError, DeviceError) as error:
            if attempt == ATTEMPTS:
                raise
            print(f"{error}\ntried {attempt} times, going on", flush=True)


def _record(folder: Path, seed: int, sessions: dict[Path, Path], speed: float, specimen: str) -> None:
    sensor, rig = sensor_file(folder / "sensors", specimen), folder / "rigs" / specimen
    (rig / "rig.yaml").unlink(missing_ok=True)
    arguments = ["virtual-rig", str(rig), "--speed", f"{speed:g}", "--seed", str(seed), "--no-camera"]
    with stages.Background([*arguments, "--sensor", str(sensor)], folder / f"{specimen}.log") as background:
        background.wait_until((rig / "rig.yaml").is_file, "a virtual rig that writes its rig file", 60.0)
        for session, plan in sessions.items():
            line = ["record", "--rig", str(rig / "rig.yaml"), "--plan", str(plan), "--out", str(session), "--yes"]
            line += ["--sensor", str(sensor), *(["--resume"] if session.exists() else [])]
            stages.Line(1, f"what was recorded is in {session}").run(f"record {session.name}", line)
            (session / "finished").touch()


def recorded(folder: Path, presses: int, speed: float) -> None:
    """Write the plans and record every session."""
    plans = folder / "plans"
    plans.mkdir(parents=True, exist_ok=True)

    def planned(name: str, what: list[str]) -> Path:
        path = plans / f"{name}.yaml"
        if not path.exists():
            stages.Line(1, "").run(f"plan {name}", ["plan", *what, "--out", str(path)])
        return path

    shapes = [word for name in SHAPES for word in ("--indenter", name)]
    main = planned("main", ["training", "--presses", str(presses), "--seed", "5", *shapes])
    evaluation = planned("evaluation", ["evaluation", "--seed", "5"])
    sessions = folder / "sessions"
    record(folder, 1, {sessions / "main": main, sessions / "evaluation": evaluation}, speed, "specimen-01")
    for k in range(WEARERS):
        count = WEARING_TRIALS // WEARERS + (k < WEARING_TRIALS % WEARERS)
        plan = planned(f"wearing-{count}", [str(wearing_plan(plans / f"wearing_recipe-{count}.yaml", count))])
        record(folder, WEARING_SEED + k, {sessions / f"wearing-{k + 1:02d}": plan}, speed, f"wearer-{k + 1:02d}")


def labelled(folder: Path, device: str) -> None:
    """Label every session out of one store."""
    for session in sorted((folder / "sessions").iterdir()):
        line = ["label", str(session), "--store", str(folder / "store"), "--no-uncertainty", "--tolerance", "0"]
        line += ["--device", device] if device != "cpu" else []
        # A press that could not be solved has no label and is left out of the dataset; the others go on.
        stages.Line(1, "labels that are finished are kept").run(
            f"label {session.name}", line, tolerated=SolveError.exit_code
        )


def packed(folder: Path) -> None:
    """Pack the sessions into datasets."""
    groups = {"main": ["main"], "evaluation": ["evaluation"]}
    groups["wearing"] = [f"wearing-{k + 1:02d}" for k in range(WEARERS)]
    for name, sessions in groups.items():
        out = folder / "datasets" / name
        if out.exists():
            shutil.rmtree(out)
        for number, session in enumerate(sessions):
            line = ["pack", str(folder / "sessions" / session), "--out", str(out), *(["--append"] if number else [])]
            stages.Line(1, "").run(f"pack {session} into {name}", line)


def main() -> None:
    """Record, label and pack."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--presses", type=int, default=216)
    parser.add_argument("--speed", type=float, default=8.0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--stage", choices=("record", "label", "pack"), action="append")
    given = parser.parse_args()
    began = time.monotonic()
    wanted = given.stage or ["record", "label", "pack"]
    if "record" in wanted:
        recorded(given.out, given.presses, given.speed)
    if "label" in wanted:
        labelled(given.out, given.device)
    if "pack" in wanted:
        packed(given.out)
    print(f"{', '.join(wanted)}: {stages.clock_face(time.monotonic() - began)}; datasets in {given.out / 'datasets'}")


if __name__ == "__main__":
    sys.exit(main())
