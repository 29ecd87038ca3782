"""Share of errors inside a pixel's interval on presses like those trained on, at the edge and on unseen shapes.

    python benchmarks/learning_curve/unseen_intervals.py SOLVED --out OUT [--presses 40] [--leave-out 5] [--rigs 1]

The network that ships is fitted to a rig of `run.py` twice: with presses left out at random, and as `tacdata train
--leave-out` does, with shapes left out in turn. No press trained on is at the edge or has one of three shapes.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import run

from tacdata.training.frames.windows import Windows
from tacdata.training.inference.predictor import deviations, predict
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.conformal_intervals import ConformalIntervals, reliability
from tacdata.training.pretraining.cross_fit import fit
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import NAME, pretrained
from tacdata.training.splits.split import divide

EVERY = 5
"""Every so manieth frame of a press is scored: neighbours hardly differ."""


def coverage(intervals: ConformalIntervals, network, frames, numbers: tuple[int, ...]) -> dict[str, float]:
    """Return the share of errors inside the 68, 90 and 95 % intervals, and the width of the first [mm]."""
    windows, maps, labels, spreads = Windows(frames, network.offsets), [], [], []
    for number in numbers:
        chosen = frames.indices((number,))[::EVERY]
        maps.append(predict(network, windows, chosen, frames.sensor.map.depth_max))
        labels.append(np.clip(frames.depth[chosen], 0.0, frames.sensor.map.depth_max))
        spreads.append(deviations(network, windows, chosen))
    levels = reliability(intervals, maps, labels, frames.sensor.map.pixel_pitch, spreads)
    rows = {row["level"]: row for row in levels}
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
        fits = {
            name: fit(
                own,
                settings,
                arguments.out / f"rig-{rig}-{name.replace(' ', '-')}",
                start,
                "cpu",
                threads=1,
                split=divide(own, "episode", rig),
                shape_groups=groups,
            )
            for name, groups in (("presses left out", None), ("shapes left out", arguments.leave_out))
        }
        seen = tuple(rest[k].number for k in chosen[arguments.presses :])
        edge = tuple(s.number for s in frames.episodes if s.number not in unseen and run.at_edge(s, frames.sensor))
        places = {"shapes pressed in training": seen, "edge": edge} | {
            name: tuple(s.number for s in frames.episodes if s.indenter == name) for name in run.UNSEEN
        }
        for calibration, trained in fits.items():
            intervals = conformal_intervals.read(trained.path.parent, trained.content_hash)
            assert intervals, f"{calibration}: no two presses touch"
            for name, numbers in places.items():
                row = coverage(intervals, trained.network, frames, numbers)
                found.append({"rig": rig, "calibrated_on": calibration, "scored_on": name, **row})
                print(found[-1], flush=True)
    (arguments.out / "coverage.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
