"""Overlap of a pressed prism between unseen specimens: centroid-aligned IoU, as `tacdata protocols`.

    python benchmarks/learning_curve/wearing.py SOLVED --out OUT [--from shipped] [--own 10]

The network that ships is fitted with 30 presses to one virtual rig, without a prism. Then twelve other rigs, each with
a skin and gains of its own, are pressed with a prism five times. With --own, it is fitted to each of them instead, with
so many presses, none of a prism.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import run

from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.plans import Press
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics.overlap import aligned_iou
from tacdata.training.networks.network import Network
from tacdata.training.pretraining.cross_fit import fit
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import NAME, pretrained
from tacdata.training.splits.split import divide

PARTICIPANTS, TRIALS = 12, 5
"""As in the paper: 57 presses of 12 participants."""
FIRST = 100
"""Seed of the first participant's rig; the learning curve's are 0 to 2."""
DEEP = 0.6
"""Least depth of a press [mm], well above the regions' threshold of 0.4 mm."""


def fitted(folder: Path, rig: int, presses: int, start, out: Path) -> Network:
    """Return the network fitted to presses of one rig, none of them on a shape held out."""
    numbers: list[int] = []

    def chosen(press: Press) -> bool:
        if press.indenter_name not in run.UNSEEN and len(numbers) < presses:
            numbers.append(press.index)
        return press.index in numbers

    frames = run.rig_frames(folder, rig, chosen)
    settings = recipe({"seed": rig}, start)
    return fit(frames, settings, out, start, "cpu", out.is_dir(), 1, split=divide(frames, "episode", rig)).network


def prisms(folder: Path) -> list[int]:
    """Return the presses of a prism over the taxels that are deep enough."""
    simulation = Simulation.read(folder)
    x, y = np.abs(simulation.sensor.taxels.centers).max(axis=0)
    presses = [simulation.press(number) for number in sorted(simulation.settled)]
    return [
        press.index
        for press in presses
        if press.indenter_name == "prism" and press.depth >= DEEP and abs(press.x) < x and abs(press.y) < y
    ]


def overlaps(network: Network, frames: Frames) -> list[float]:
    """Return the aligned overlap of each press, both maps averaged over the frames at full depth."""
    top, found = frames.sensor.map.depth_max, []
    for span in frames.episodes:
        depth = frames.tip[span.start : span.stop, 2]
        full = span.start + np.flatnonzero(depth >= depth.max() - 0.01)
        predicted = predict(network, Windows(frames, network.offsets), full, top).mean(axis=0)
        found.append(aligned_iou(predicted, np.clip(frames.depth[full], 0.0, top).mean(axis=0)) or 0.0)
    return found


def main() -> None:
    """Print and write mean and deviation over participants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--from", dest="start", default=NAME)
    parser.add_argument("--own", type=int, default=0, help="presses of each participant's own rig to fit to")
    arguments = parser.parse_args()
    start, rows = pretrained(arguments.start), {}
    network = None if arguments.own else fitted(arguments.solved, 0, 30, start, arguments.out / "fitted")
    for rig in range(FIRST, FIRST + PARTICIPANTS):
        own = network or fitted(arguments.solved, rig, arguments.own, start, arguments.out / f"fitted-{rig}")
        pressed = set(np.random.default_rng(rig).choice(prisms(arguments.solved), TRIALS, replace=False).tolist())
        frames = run.rig_frames(arguments.solved, rig, lambda press, pressed=pressed: press.index in pressed)
        rows[rig] = {"fitted": overlaps(own, frames), "as it ships": overlaps(start.network, frames)}
        print(rig, {name: np.round(values, 3).tolist() for name, values in rows[rig].items()}, flush=True)
    for name in ("fitted", "as it ships"):
        means = np.array([np.mean(row[name]) for row in rows.values()])
        print(
            f"{name}: {means.mean():.3f} ± {means.std(ddof=1):.3f}, lowest {means.min():.3f}, highest {means.max():.3f}"
        )
    (arguments.out / "wearing.json").write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
