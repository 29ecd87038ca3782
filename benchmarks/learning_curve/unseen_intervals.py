"""Share of errors inside a pixel's interval on shapes that no press trained on has.

    python benchmarks/learning_curve/unseen_intervals.py SOLVED --out OUT [--presses 40] [--leave-out 5] [--rigs 1]

The network that ships is fitted to a rig of `run.py`. Its intervals are calibrated twice: on validation presses, and as
`tacdata train --leave-out` does, on shapes left out in turn. Both are scored on three shapes that it never saw.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import run

from tacdata.training.frames.windows import Windows
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.conformal_intervals import ConformalIntervals, reliability
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import NAME, pretrained
from tacdata.training.pretraining.unseen_shapes import calibrate_on_unseen_shapes
from tacdata.training.splits.split import divide
from tacdata.training.train import train

EVERY = 5
"""Every so manieth frame of a press is scored: neighbours hardly differ."""


def coverage(intervals: ConformalIntervals, network, frames, numbers: tuple[int, ...]) -> dict[str, float]:
    """Return the share of errors inside the 68, 90 and 95 % intervals, and the width of the first [mm]."""
    windows, maps, labels = Windows(frames, network.offsets), [], []
    for number in numbers:
        chosen = frames.indices((number,))[::EVERY]
        maps.append(predict(network, windows, chosen, frames.sensor.map.depth_max))
        labels.append(np.clip(frames.depth[chosen], 0.0, frames.sensor.map.depth_max))
    rows = {row["level"]: row for row in reliability(intervals, maps, labels, frames.sensor.map.pixel_pitch)}
    return {
        **{f"{level:g}": rows[level]["inside"] for level in (0.68, 0.9, 0.95)},
        "width": rows[0.68]["mean_width_mm"],
    }


def main() -> None:
    """Print and write the coverage of each rig, calibration and shape."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--from", dest="start", default=NAME)
    parser.add_argument("--presses", type=int, default=40)
    parser.add_argument("--leave-out", type=int, default=5)
    parser.add_argument("--rigs", type=int, default=1)
    arguments = parser.parse_args()
    start, found = pretrained(arguments.start), []
    for rig in range(arguments.rigs):
        frames = run.rig_frames(arguments.solved, rig)
        unseen = tuple(span.number for span in frames.episodes if span.indenter in run.UNSEEN)
        rest = [s for s in frames.episodes if s.number not in unseen and not run.at_edge(s, frames.sensor)]
        chosen = np.random.default_rng(rig).permutation(len(rest))
        kept = [rest[k] for k in chosen[: arguments.presses]]
        own = run.part(frames, kept)
        settings = recipe({"seed": rig}, start)
        trained = train(
            own,
            settings,
            arguments.out / f"rig-{rig}",
            "cpu",
            threads=1,
            pretrained=start,
            split=divide(own, "episode", rig),
        )
        folder = trained.path.parent
        before = conformal_intervals.read(folder, trained.content_hash)
        after = calibrate_on_unseen_shapes(trained, own, arguments.leave_out, "cpu", threads=1, pretrained=start)
        seen = tuple(rest[k].number for k in chosen[arguments.presses :])
        places = {"shapes pressed in training": seen} | {
            name: tuple(s.number for s in frames.episodes if s.indenter == name) for name in run.UNSEEN
        }
        for calibration, intervals in (("validation presses", before), ("shapes left out", after)):
            for name, numbers in places.items():
                row = coverage(intervals, trained.network, frames, numbers)
                found.append({"rig": rig, "calibrated_on": calibration, "scored_on": name, **row})
                print(found[-1], flush=True)
    (arguments.out / "coverage.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
