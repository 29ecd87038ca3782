"""Errors of a network on a flat pad by the number of presses: `examples/own_sensor.yaml` on the virtual rig.

    python benchmarks/learning_curve/flat_pad.py --out OUT [--rigs 3] [--networks dent,direct] [--presses 3,10]

A label of the solver costs 16 CPU s here. So labels are the shapes' own surfaces, without the skin's bulge beside them.
Sixteen presses are held out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from tacdata import read_sensor
from tacdata.indenters import from_document
from tacdata.rig import Registration
from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics.depth_maps import score_frames
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.splits.split import Split
from tacdata.training.train import train
from tacdata.virtual_rig.world.world import World, draw

SHAPES = {
    "sphere_2": {"shape": "sphere", "radius": 2.0},
    "sphere_4": {"shape": "sphere", "radius": 4.0},
    "punch": {"shape": "flat_punch", "radius": 1.5, "edge_radius": 0.3},
}
PRESSES, HELD_OUT, EPOCHS = 30, 16, 60
STEP = 33_000_000
"""Time between frames [ns]."""


def surface(shape: dict, distance: np.ndarray, depth: float) -> np.ndarray:
    """Return how far a shape reaches below the pad's plane [mm], at distances from its axis [mm]."""
    if shape["shape"] == "flat_punch":
        return np.where(distance <= shape["radius"], max(depth, 0.0), 0.0)
    rise = shape["radius"] - np.sqrt(np.maximum(shape["radius"] ** 2 - distance**2, 0.0))
    return np.where(distance < shape["radius"], np.maximum(depth - rise, 0.0), 0.0)


def pressed(sensor: Sensor, rig: int) -> Frames:
    """Return random presses as the virtual rig ``rig`` reads them."""
    world, rng = World(draw(rig, sensor, Registration((0.0, 0.0, 0.0), 0.0)), sensor), np.random.default_rng(rig)
    along = [(np.arange(count) - (count - 1) / 2) * sensor.map.pixel_pitch for count in sensor.map.shape]
    limit, clock, start, spans, parts = np.abs(sensor.taxels.centers).max(axis=0), 0, 0, [], []
    for number in range(PRESSES):
        name = list(SHAPES)[number % len(SHAPES)]
        indenter, (x, y), deepest = from_document(SHAPES[name]), rng.uniform(-limit, limit), rng.uniform(0.3, 1.2)
        way = np.linspace(-0.2, deepest, 25)
        depth = np.concatenate([np.full(20, -1.0), way, np.full(15, deepest), way[::-1]])
        tips = np.column_stack([np.full_like(depth, x), np.full_like(depth, y), depth])
        times = np.arange(len(depth)) * STEP
        counts = np.array(
            [
                world.readings(tip * (1.0, 1.0, -1.0), indenter, 0.0, clock + int(t))
                for tip, t in zip(tips, times, strict=True)
            ]
        )
        distance = np.hypot(along[0][:, None] - x, along[1] - y)
        maps = np.array([surface(SHAPES[name], distance, d) for d in depth])
        parts.append((counts - counts[:20].mean(axis=0), maps, tips, times))
        spans.append(EpisodeSpan(number, start, start + len(depth), name, indenter.shape, x, y, deepest, 0.5))
        start, clock = start + len(depth), clock + 5_000_000_000
    taxels, maps, tips, times = (np.concatenate(part) for part in zip(*parts, strict=True))
    taxels, maps, tips = (part.astype(np.float32) for part in (taxels, maps, tips))
    valid, phase = np.ones(start, bool), np.full(start, 2)
    origin = f"virtual rig {rig}"
    return Frames(taxels, maps, tips, phase, times, valid, tuple(spans), sensor, f"{rig:064x}", origin, True)


def main() -> None:
    """Print a row for each rig, network and number of presses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rigs", type=int, default=3)
    parser.add_argument("--networks", default="dent,direct")
    parser.add_argument("--presses", default="3,10")
    given = parser.parse_args()
    sensor = read_sensor(Path(__file__).parents[2] / "examples" / "own_sensor.yaml")
    for rig in range(given.rigs):
        frames = pressed(sensor, rig)
        test = tuple(range(PRESSES - HELD_OUT, PRESSES))
        indices = frames.indices(test)
        deep = frames.depth[indices].max(axis=(1, 2)) > 0.2
        for name in given.networks.split(","):
            for count in map(int, given.presses.split(",")):
                division = Split("episode", rig, tuple(range(count)), (count, count + 1), test)
                settings = recipe({"seed": rig, "network": name, "epochs": EPOCHS})
                out = given.out / f"{rig}-{name}-{count}"
                network = train(frames, settings, out, "cpu", threads=1, split=division, part=True).network
                top = sensor.map.depth_max
                scores = score_frames(
                    predict(network, Windows(frames, network.offsets), indices, top), frames.depth[indices]
                )
                centroid = np.nanquantile(scores.centroid_error[scores.labelled], [0.5, 0.9])
                rmse, overlap = np.median(scores.contact_rmse[scores.labelled]), scores.iou[deep].mean()
                print(
                    f"rig {rig}, {name}, {count} presses: centroid {centroid.round(2)} px, "
                    f"RMSE {rmse:.3f} mm, IoU {overlap:.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
