"""Overlap that the virtual rig's noise allows: the best possible predictor, over the depth of the contact.

    python benchmarks/learning_curve/noise_limit.py SOLVED --out OUT [--rigs 3] [--runs RUNS --presses 100]

With --runs, the folder that `run.py` wrote, the fitted network is added to the table: on the same presses held out, at
the edge, and on shapes that it never saw.

The library holds every frame of the solved presses with the readings that the rig would give without noise and drift. A
frame held out gets the rig's noise; the frames of its own press are left out of the library. Bayes' rule with the
known noise then gives the probability of each library frame, and with it of each pixel to be in contact. No predictor
does better on average than the region that these probabilities favour, from one frame; several frames may tell more.
The library is finite: where readings are far above the noise, no library frame is near, and it is a lower bound.
"""

from __future__ import annotations

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import run

from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD, score_frames
from tacdata.virtual_rig.world import world

DEPTHS = (0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 2.0)
"""Borders of the largest labelled depth [mm]."""
LEVELS = np.arange(0.1, 0.95, 0.05)
"""Probabilities above which a pixel counts as in contact; the best one is taken for each depth [1]."""
WIDENED = (1.0, 2.0, 4.0, 8.0)
"""Factors of the noise: a finite library needs some width; the best one is taken for each depth [1]."""


def exact_frames(folder: Path, rig: int):
    """Return the presses as the rig reads them without noise and drift."""
    run.draw = lambda *drawn: replace(world.draw(*drawn), noise=0.0, drift=0.0)
    try:
        return run.rig_frames(folder, rig)
    finally:
        run.draw = world.draw


def limit(
    frames, noise: float, drift: float, count: int, rng: np.random.Generator, held_out: np.ndarray
) -> list[dict[str, float]]:
    """Return the overlap that the best predictor reaches on frames held out, for each range of depths."""
    deepest = frames.depth.max(axis=(1, 2))
    press = np.concatenate([np.full(span.stop - span.start, k) for k, span in enumerate(frames.episodes)])
    inside = frames.depth.reshape(len(frames.depth), -1) > CONTACT_THRESHOLD
    library = np.flatnonzero(deepest > 0.02)
    readings, regions = frames.taxels[library].astype(np.float64), inside[library].astype(np.float32)
    squares = (readings**2).sum(axis=1)
    # Readings are tared over REST seconds at the board's rate.
    spread = np.sqrt(noise**2 * (1 + 1 / (run.REST * frames.sensor.taxels.rate)) + drift**2 / 12)
    rows = []
    for low, high in itertools.pairwise(DEPTHS):
        chosen = np.flatnonzero((deepest > low) & (deepest <= high) & held_out)
        chosen = rng.permutation(chosen)[:count]
        overlap = np.zeros((len(chosen), len(WIDENED), len(LEVELS)))
        for row, frame in enumerate(chosen):
            noisy = frames.taxels[frame] + rng.normal(0.0, spread, frames.taxels.shape[1])
            distance = squares - 2 * readings @ noisy + noisy @ noisy
            distance[press[library] == press[frame]] = np.inf
            for k, factor in enumerate(WIDENED):
                weight = np.exp(-0.5 * (distance - distance.min()) / (factor * spread) ** 2)
                near = np.flatnonzero(weight > 1e-4)
                probability = (weight[near] / weight[near].sum()).astype(np.float32) @ regions[near]
                found = probability > LEVELS[:, None]
                union = (found | inside[frame]).sum(axis=1)
                overlap[row, k] = (found & inside[frame]).sum(axis=1) / np.maximum(union, 1)
        best = overlap.mean(axis=0).max() if len(chosen) else float("nan")
        rows.append({"above_mm": low, "up_to_mm": high, "frames": len(chosen), "iou": float(best)})
    return rows


def apart(frames, trained: Checkpoint) -> dict[str, np.ndarray]:
    """Return which frames are held out [bool], shape (n,): of shapes and places trained on, of others, at the edge."""
    spans = frames.episodes
    unseen = {span.number for span in spans if span.indenter in run.UNSEEN}
    edge = {span.number for span in spans if span.number not in unseen and run.at_edge(span, frames.sensor)}
    found = {}
    for name, numbers in (("held out", trained.split.test), ("edge", edge), ("unseen shapes", unseen)):
        found[name] = np.zeros(len(frames.taxels), bool)
        found[name][frames.indices(tuple(sorted(numbers)))] = True
    return found


def of_network(trained: Checkpoint, frames, held_out: np.ndarray) -> list[float]:
    """Return the overlap that a network reaches on the rig's own readings, for each range of depths."""
    top, deepest = frames.sensor.map.depth_max, frames.depth.max(axis=(1, 2))
    chosen = np.flatnonzero((deepest > DEPTHS[0]) & held_out)
    found = predict(trained.network, Windows(frames, trained.network.offsets), chosen, top)
    iou = score_frames(found, frames.depth[chosen]).iou
    return [float(iou[(deepest[chosen] > a) & (deepest[chosen] <= b)].mean()) for a, b in itertools.pairwise(DEPTHS)]


def main() -> None:
    """Print and write the table of each rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rigs", type=int, default=3)
    parser.add_argument("--frames", type=int, default=300, help="frames held out in each range of depths")
    parser.add_argument("--runs", type=Path, help="folder that run.py wrote")
    parser.add_argument("--presses", type=int, default=100, help="presses that the network was fitted with")
    arguments = parser.parse_args()
    found = []
    for rig in range(arguments.rigs):
        frames, trained = exact_frames(arguments.solved, rig), None
        places = {"all": np.ones(len(frames.taxels), bool)}
        if arguments.runs:
            trained = checkpoint.load(arguments.runs / f"rig-{rig}" / f"pretrained-{arguments.presses}-{rig}")
            noisy, places = run.rig_frames(arguments.solved, rig), apart(frames, trained)
        for place, held_out in places.items():
            rows = limit(frames, 5.0, 4.0, arguments.frames, np.random.default_rng(rig), held_out)
            beside = of_network(trained, noisy, held_out) if trained else None
            for k, row in enumerate(rows):
                found.append({"rig": rig, "on": place, **row, **({"network": beside[k]} if beside else {})})
                print(found[-1], flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "noise_limit.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
