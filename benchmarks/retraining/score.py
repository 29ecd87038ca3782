"""Scores networks as the learning curve's benchmark does, on rigs and presses of other seeds than its own.

The benchmark's rigs 0 to 2 and 100 to 111 and its presses of seed 0 stay unseen: a variant is chosen here, on rigs 20
to 22 and 300 to 305 and on presses of seed 1. The chosen one is scored there once.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "learning_curve"))
import model_forces
import run
import wearing

from tacdata.training.inference import checkpoint
from tacdata.training.pretraining.learning_curve import learning_curve
from tacdata.training.pretraining.shipped import pretrained

RIGS = (20, 21, 22)
WEARERS = range(300, 306)
PRESSES = 10


def on_rig(
    start: str, rig_presses: Path, contacts: Path, rig: int, out: Path, counts: tuple[int, ...] = (PRESSES,)
) -> dict[str, Any]:
    """Return the scores of a network fitted to a rig, with ten presses and perhaps with other numbers of them."""
    shutil.rmtree(out, ignore_errors=True)  # an incomplete run
    frames, others = run.rig_frames(rig_presses, rig), run.rig_frames(contacts, rig)
    unseen = [span for span in frames.episodes if span.indenter in run.UNSEEN]
    edge = [span for span in frames.episodes if span not in unseen and run.at_edge(span, frames.sensor)]
    rest = [span for span in frames.episodes if span not in unseen and span not in edge]
    document = learning_curve(run.part(frames, rest), pretrained(start), out, counts, (rig,), networks=(), threads=1)
    held = run.part(frames, list(frames.spans(tuple(document["held_out"]))))
    rows: dict[int, dict[str, Any]] = {}
    for count in [n for n in counts if (out / f"pretrained-{n}-{rig}").is_dir()]:  # counts with presses
        network = checkpoint.load(out / f"pretrained-{count}-{rig}").network
        rows[count] = {"held out": run.scores(network, held)}
        for name, spans in (("unseen shapes", unseen), ("edge", edge)):
            if spans:
                rows[count][name] = run.scores(network, run.part(frames, spans))
        rows[count]["contacts"] = {**run.contacts(network, held), **run.contacts(network, others)}
    return {**rows[PRESSES], "other numbers of presses": {n: row for n, row in rows.items() if n != PRESSES}}


def worn(
    start: str, rig_presses: Path, out: Path, fitted_to: int = RIGS[0], wearers: range = WEARERS
) -> dict[str, float]:
    """Return the aligned overlap of prisms on rigs that a network never saw, fitted to one other rig."""
    shutil.rmtree(out, ignore_errors=True)  # an incomplete run
    network = wearing.fitted(rig_presses, fitted_to, 30, pretrained(start), out)
    prisms, means = wearing.prisms(rig_presses), []
    for rig in wearers:
        count = min(wearing.TRIALS, len(prisms))
        pressed = set(np.random.default_rng(rig).choice(prisms, count, replace=False).tolist())
        frames = run.rig_frames(rig_presses, rig, lambda press, pressed=pressed: press.index in pressed)
        means.append(float(np.mean(wearing.overlaps(network, frames))))
    return {"aligned_iou": float(np.mean(means)), "sd": float(np.std(means, ddof=1))}


def on_forces(start: str, rig_presses: Path, contacts: Path) -> dict[str, Any]:
    """Return the error of a network on the model's own forces: nothing is unknown but the press."""
    network = pretrained(start).network
    network.is_calibrated = False  # it takes forces as they are
    frames = model_forces.exact(rig_presses)
    x, y = np.abs(frames.sensor.taxels.centers).max(axis=0)
    ridges = [
        span
        for span in frames.episodes
        if span.indenter == "prism" and span.depth >= wearing.DEEP and abs(span.x) < x and abs(span.y) < y
    ]
    found: dict[str, Any] = {
        "all presses": run.scores(network, frames),
        "contacts": run.contacts(network, model_forces.exact(contacts)),
    }
    if ridges:
        found["prism, aligned IoU"] = float(np.mean(wearing.overlaps(network, run.part(frames, ridges))))
    return found
