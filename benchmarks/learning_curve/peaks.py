"""Errors of ridge regression, calibration alone, the fitted network without and with its maxima corrected.

    tacdata simulate benchmarks/learning_curve/rig_presses.yaml --solved SOLVED --presses 420 --seed 11
    python benchmarks/learning_curve/peaks.py SOLVED --out OUT --rig 40 [--presses 3,8,30,96]

Rigs and shapes as in `run.py`. A fifth of the presses inside is held out; the others are drawn from in one order.
Medians over every fourth frame in contact of the presses held out, over every sixth of unseen shapes and of the edge.
Of the corrected network also the share of errors inside its intervals.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import run
from unseen_intervals import coverage

from tacdata.training.frames.channel_calibration import calibrate
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.depth_maps import score_frames, summarize
from tacdata.training.networks.network import Network
from tacdata.training.pretraining.cross_fit import fit
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import NAME, pretrained
from tacdata.training.scoring import baselines
from tacdata.training.splits.split import VALIDATION_SHARE, Split, share

STREAM = 99
"""Separates the draw of presses from the rig's own random numbers."""


def frames_of(spans: list[EpisodeSpan], step: int) -> np.ndarray:
    """Return every ``step``-th frame of some presses, shape (m,)."""
    return np.concatenate([np.arange(span.start, span.stop)[::step] for span in spans])


def maps_of(network: Network, frames: Frames, chosen: np.ndarray) -> np.ndarray:
    """Return the depth maps of some frames [mm]."""
    return predict(network, Windows(frames, network.offsets), chosen, frames.sensor.map.depth_max)


def row(maps: np.ndarray, label: np.ndarray) -> dict[str, float | None]:
    """Return median and 90th percentile of the peak error, and the medians of the other metrics."""
    scores = score_frames(maps, label)
    scores = scores.where(scores.labelled)
    peak = summarize(scores.peak_error)
    names = ("pixel_rmse", "contact_rmse", "centroid_error", "iou")
    return {"peak": peak.median, "peak_p90": peak.p90} | {n: summarize(getattr(scores, n)).median for n in names}


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--from", dest="start", default=NAME)
    parser.add_argument("--rig", type=int, default=40)
    parser.add_argument("--presses", default="3,8,30,96")
    given = parser.parse_args()
    frames, start, found = run.rig_frames(given.solved, given.rig), pretrained(given.start), []
    unseen = [span for span in frames.episodes if span.indenter in run.UNSEEN]
    edge = [span for span in frames.episodes if span not in unseen and run.at_edge(span, frames.sensor)]
    rest = [span.number for span in frames.episodes if span not in unseen and span not in edge]
    order = np.random.default_rng([given.rig, STREAM]).permutation(rest).tolist()
    held, pool = set(order[: len(order) // 5]), order[len(order) // 5 :]
    spans = {"held out": list(frames.spans(tuple(held))), "unseen shapes": unseen, "edge": edge}
    places = {place: frames_of(some, 4 if place == "held out" else 6) for place, some in spans.items()}
    for count in map(int, given.presses.split(",")):
        numbers, validated = pool[:count], share(count, VALIDATION_SHARE)
        train_on, validation = (tuple(sorted(part)) for part in (numbers[validated:], numbers[:validated]))
        division = Split("episode", given.rig, train_on, validation, tuple(sorted(held)))
        every = Split("episode", given.rig, tuple(sorted(numbers)), (), division.test)
        settings, out = recipe({"seed": given.rig}, start), given.out / f"rig-{given.rig}-{count}"
        fitted = fit(frames, settings, out, start, "cpu", out.is_dir(), 1, split=division)
        network, alone, unit = fitted.network, pretrained(given.start).network, calibrate(frames, every.train)
        alone.set_calibration(unit.gain, unit.exponent, unit.mixing)
        intervals = conformal_intervals.read(out, fitted.content_hash)
        print(count, "presses, cross-fit", fitted.document.get("cross_fit"), flush=True)
        for place, chosen in places.items():
            label = np.clip(frames.depth[chosen], 0.0, frames.sensor.map.depth_max)
            maps, peak = {"ridge": baselines.predictions(frames, every, chosen)["linear"]}, network.peak
            maps["network"] = maps_of(network, frames, chosen)
            network.peak = None
            maps["network, not corrected"] = maps_of(network, frames, chosen)
            network.peak, maps["calibration alone"] = peak, maps_of(alone, frames, chosen)
            for name, predicted in maps.items():
                found.append({"presses": count, "on": place, "predictor": name, **row(predicted, label)})
                if intervals and name == "network":
                    found[-1] |= coverage(intervals, network, frames, tuple(span.number for span in spans[place]))
                print(found[-1], flush=True)
    (given.out / "peaks.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
