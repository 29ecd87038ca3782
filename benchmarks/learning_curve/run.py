"""How many presses of the virtual rig a network needs, started from simulated presses and from random weights.

    tacdata simulate benchmarks/learning_curve/rig_presses.yaml --solved SOLVED --presses 500
    python benchmarks/learning_curve/run.py SOLVED --out OUT [--from shipped] [--simulated DATASET] [--rigs 3]
    tacdata simulate benchmarks/learning_curve/rig_contacts.yaml --solved CONTACTS --presses 240
    python benchmarks/learning_curve/run.py SOLVED --contacts CONTACTS --out OUT

The presses are solved once: nominal poses, as labels are. The readings are those of the virtual rig's world, whose skin
is not the model's: other contact, other taxels, relaxation, gains, an indenter and a sensor that lie a little aside.
The wires, the recorder and the controller are left out, as they take hours. Held out are three shapes, presses at the
edge, and a sixth of the others. With --contacts, pairs and wide contacts are scored too; nothing is trained on them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from tacdata import documents
from tacdata.label_farm.simulated.packing import simulated_episode
from tacdata.label_farm.simulated.plan import SimulationPlan
from tacdata.label_farm.simulated.shard import read_shard, shard_files
from tacdata.label_farm.simulated.simulation import FILE, Simulation
from tacdata.plans import Press
from tacdata.rig import Registration
from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.metrics.contacts import ContactMatch, match
from tacdata.training.metrics.depth_maps import score_frames
from tacdata.training.pretraining import curve_picture
from tacdata.training.pretraining.learning_curve import DEEP, learning_curve
from tacdata.training.pretraining.shipped import NAME, pretrained
from tacdata.virtual_rig.world.world import World, draw

UNSEEN = ("square", "ring", "prism")
"""Shapes that no press to train on has."""
REST = 0.9
"""Time before a press over which its readings are tared [s]."""
torch.set_num_threads(1)  # rigs may be run in parallel


def rig_frames(folder: Path, rig: int, only: Callable[[Press], bool] = lambda press: True) -> Frames:
    """Return solved presses as the virtual rig ``rig`` reads them, labelled as a recording is.

    Args:
        folder: Where the solved presses lie.
        rig: The rig's seed.
        only: Which presses are pressed.
    """
    document = documents.read(folder / FILE, "simulation")
    sensor = Sensor.from_document(document["sensor"], str(folder))
    plan = SimulationPlan.from_document(document["plan"], str(folder))
    simulation = Simulation(folder, plan, sensor, document["seed"], document["mesh_error"])
    nominal = Registration((0.0, 0.0, 0.0), 0.0)
    world, clock = World(draw(rig, sensor, nominal), sensor), 0
    spans, parts, start = [], [], 0
    for path in shard_files(folder):
        for number, solution in sorted(read_shard(path).solutions.items()):
            if not only(simulation.press(number)):
                continue
            episode, label = simulated_episode(simulation, number, solution)
            press, times = episode.press, label.time_ns
            tips = label.tip * (1.0, 1.0, -1.0)
            counts = np.array(
                [
                    world.readings(tip, press.indenter, press.yaw, clock + int(t))
                    for tip, t in zip(tips, times, strict=True)
                ]
            )
            clock += int(times[-1]) + 5_000_000_000
            taxels = counts - counts[times < REST * 1e9].mean(axis=0)
            maps = np.clip(label.signed, 0.0, sensor.map.depth_max)
            parts.append((taxels, maps, label.tip, times, label.taxel_force))
            stop = start + len(times)
            spans.append(
                EpisodeSpan(
                    number,
                    start,
                    stop,
                    press.indenter_name,
                    press.indenter.shape,
                    press.x,
                    press.y,
                    press.depth,
                    press.speed,
                )
            )
            start = stop
    taxels, maps, tips, times, force = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Frames(
        taxels.astype(np.float32),
        maps.astype(np.float32),
        tips.astype(np.float32),
        np.full(start, 2),
        times,
        np.ones(start, bool),
        tuple(spans),
        sensor,
        f"{rig:064x}",
        f"virtual rig {rig}",
        True,
        taxel_force=force.astype(np.float32),
    )


def part(frames: Frames, kept: list[EpisodeSpan]) -> Frames:
    """Return the frames of some presses."""
    chosen = np.concatenate([np.arange(span.start, span.stop) for span in kept])
    ends = np.cumsum([span.stop - span.start for span in kept])
    spans = tuple(
        replace(span, start=int(end) - (span.stop - span.start), stop=int(end))
        for span, end in zip(kept, ends, strict=True)
    )
    names = ("taxels", "depth", "tip", "phase", "time_ns", "valid", "taxel_force")
    return replace(frames, episodes=spans, **{name: getattr(frames, name)[chosen] for name in names})


def at_edge(span: EpisodeSpan, sensor: Sensor) -> bool:
    """Return whether a press is outside the taxels' centres."""
    x, y = np.abs(sensor.taxels.centers).max(axis=0)
    return abs(span.x) > x or abs(span.y) > y


def scores(network, frames: Frames) -> dict[str, float]:
    """Return the errors of a network on all presses of some frames."""
    from tacdata.training.frames.windows import Windows
    from tacdata.training.inference.predictor import predict

    top = frames.sensor.map.depth_max
    found = predict(network, Windows(frames, network.offsets), np.arange(len(frames.taxels)), top)
    rows, deep = score_frames(found, frames.depth), frames.depth.max(axis=(1, 2)) > DEEP
    return {
        "centroid": float(np.nanmedian(rows.centroid_error[rows.labelled])),
        "contact_rmse": float(np.median(rows.contact_rmse[rows.labelled])),
        "iou": float(np.median(rows.iou[rows.labelled])),
        "iou_mean": float(rows.iou[rows.labelled].mean()),
        "iou_deep": float(rows.iou[deep].mean()),
    }


def contacts(network, frames: Frames) -> dict[str, dict[str, float]]:
    """Return for each indenter how often all contacts of a press are found at full depth, how far off, the overlap."""
    from tacdata.training.frames.windows import Windows
    from tacdata.training.inference.predictor import predict

    top, windows = frames.sensor.map.depth_max, Windows(frames, network.offsets)
    found: dict[str, list[tuple[ContactMatch, float]]] = {}
    for span in frames.episodes:
        depth = frames.tip[span.start : span.stop, 2]
        full = span.start + np.flatnonzero(depth >= depth.max() - 0.01)
        label = np.clip(frames.depth[full], 0.0, top).mean(axis=0)
        predicted = predict(network, windows, full, top).mean(axis=0)
        overlap = float(score_frames(predicted[None], label[None]).iou[0])
        found.setdefault(span.indenter, []).append((match(predicted, label, frames.sensor.map.pixel_pitch), overlap))
    return {name: _found(matches) for name, matches in sorted(found.items())}


def _found(presses: list[tuple[ContactMatch, float]]) -> dict[str, float]:
    matches = [one for one, _ in presses]
    errors = np.concatenate([one.error for one in matches])
    return {
        "presses": len(matches),
        "contacts": float(np.mean([len(one.labelled) for one in matches])),
        "all_found": float(np.mean([not one.missed for one in matches])),
        "invented": float(np.mean([one.invented > 0 for one in matches])),
        "centroid": float(np.nanmedian(errors)) if np.isfinite(errors).any() else float("nan"),
        "iou": float(np.median([overlap for _, overlap in presses])),
    }


def main() -> None:
    """Draw the curve of each rig; print the table over rigs and seeds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--from", dest="start", default=NAME)
    parser.add_argument("--presses", default="0,3,10,30,100,300")
    parser.add_argument("--rigs", type=int, default=3)
    parser.add_argument("--simulated", type=Path)
    parser.add_argument("--contacts", type=Path, help="solved presses of rig_contacts.yaml")
    parser.add_argument("--network", nargs="*", default=["pattern", "paper"])
    arguments = parser.parse_args()
    start, numbers = pretrained(arguments.start), [int(n) for n in arguments.presses.split(",")]
    simulated = None
    if arguments.simulated:
        from tacdata.training.frames.data import read_frames

        simulated = read_frames(arguments.simulated)
    merged, apart = None, []
    for rig in range(arguments.rigs):
        frames = rig_frames(arguments.solved, rig)
        unseen = [span for span in frames.episodes if span.indenter in UNSEEN]
        edge = [span for span in frames.episodes if span not in unseen and at_edge(span, frames.sensor)]
        rest = [span for span in frames.episodes if span not in unseen and span not in edge]
        others = rig_frames(arguments.contacts, rig) if arguments.contacts else None
        folder = arguments.out / f"rig-{rig}"
        document = learning_curve(
            part(frames, rest),
            start,
            folder,
            numbers,
            (rig,),
            networks=arguments.network,
            simulated=simulated,
            threads=1,
            report=lambda point: print(point, flush=True),
        )
        for run in sorted(folder.glob("*-*-*")):
            from tacdata.training.inference import checkpoint

            network = checkpoint.load(run).network
            for name, spans in (("unseen shapes", unseen), ("edge", edge)):
                if not spans:
                    continue
                apart.append({"run": run.name, "rig": rig, "on": name, **scores(network, part(frames, spans))})
                print(apart[-1], flush=True)
            if others:
                test = part(frames, list(frames.spans(tuple(document["held_out"]))))
                both = {**contacts(network, test), **contacts(network, others)}
                apart.append({"run": run.name, "rig": rig, "on": "contacts", "indenters": both})
                print(apart[-1], flush=True)
        merged = document if merged is None else {**merged, "points": [*merged["points"], *document["points"]]}
    assert merged, "no rig was asked for"
    curve_picture.draw(arguments.out / "curve.png", merged)
    (arguments.out / "apart.json").write_text(json.dumps(apart, indent=1) + "\n")
    print(curve_picture.table(merged))


if __name__ == "__main__":
    main()
