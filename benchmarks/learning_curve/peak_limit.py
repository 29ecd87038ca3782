"""Error of the deepest pixel that no predictor can go below, and the error that a rig's own presses allow.

    python benchmarks/learning_curve/peak_limit.py [SOLVED] [--rig 60] [--frames 60]

Noise alone: the predictor knows the rig's skin and the plan's eight shapes, and reads one frame with the rig's noise.
For each shape it fits place, yaw and depth to the readings. Laplace's method gives the shapes' probabilities, and the
median of the depth is the answer. Up to that approximation no other predictor has a smaller mean error from one frame.

With SOLVED, neighbours: the predictor knows no skin but all other presses of this rig, 400 and more. A line is fitted
through the nearest frames of other presses, over the newest readings and those of half a second before.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import run
from pair_limit import PairReadings
from scipy.optimize import least_squares

from tacdata import documents
from tacdata.indenters import Indenter, from_document
from tacdata.sensor import default_sensor

PRIOR = np.array([3.0, 3.0, 0.4, 2.0])
"""Standard deviations of place [mm], depth [mm] and yaw [rad] before a reading."""
NEAREST = 120
"""Frames that a line is fitted through."""
BACK = 16
"""Frames between the newest readings and the earlier ones."""
DRAWS = 200


def of_noise(rig: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return the peak error of frames of random presses [mm], shape (count,)."""
    sensor = default_sensor()
    plan = documents.read(Path(__file__).with_name("rig_presses.yaml"), "simulation_plan")
    shapes = [from_document(shape) for shape in plan["shapes"].values()]
    readings = PairReadings(rig, sensor, 1.0)
    truth = readings.world.truth
    spread = np.sqrt(truth.noise**2 * (1 + 1 / (run.REST * sensor.taxels.rate)) + truth.drift**2 / 12)
    x, y = np.abs(sensor.taxels.centers).max(axis=0)
    errors = []
    while len(errors) < count:
        # A quarter of the frames in contact is at full depth, the others are on the way.
        depth = rng.uniform(*plan["depth"]) * (1.0 if rng.random() < 0.25 else rng.random())
        if depth < 0.1:
            continue
        state = np.array([rng.uniform(-x, x), rng.uniform(-y, y), depth, rng.uniform(0.0, 2 * np.pi)])
        own = int(rng.integers(len(shapes)))
        counts = readings.of(state, shapes[own]) + rng.normal(0.0, spread, sensor.taxels.count)
        evidence, draws = [], []
        for k, shape in enumerate(shapes):
            turns = (0.0,) if k == own else (0.0, 1.0)
            fits = [_fitted(readings, counts, spread, shape, state + np.array([0, 0, 0, turn])) for turn in turns]
            best = min(fits, key=lambda fit: fit.cost)
            covariance = np.linalg.inv(best.jac.T @ best.jac)
            evidence.append(-best.cost + 0.5 * np.linalg.slogdet(covariance)[1])
            draws.append(rng.normal(best.x[2], np.sqrt(covariance[2, 2]), DRAWS))
        weight = np.exp(np.array(evidence) - max(evidence))
        errors.append(abs(_median(np.concatenate(draws), np.repeat(weight, DRAWS)) - depth))
    return np.array(errors)


def of_neighbours(frames, count: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return the peak error of frames held out, inside, of unseen shapes and at the edge [mm], shapes (count,)."""
    spans = frames.episodes
    press = np.repeat(np.arange(len(spans)), [span.stop - span.start for span in spans])
    earlier = np.maximum(np.arange(len(press)) - BACK, np.array([span.start for span in spans])[press])
    window = np.hstack([frames.taxels, frames.taxels[earlier]]).astype(np.float64) / 1000.0
    peak = np.clip(frames.depth.max(axis=(1, 2)), 0.0, frames.sensor.map.depth_max)
    library = np.flatnonzero(peak > 0.02)[::2]
    unseen = np.array([span.indenter in run.UNSEEN for span in spans])
    edge = np.array([run.at_edge(span, frames.sensor) for span in spans]) & ~unseen
    found = {}
    for name, mask in (("held out", ~unseen & ~edge), ("unseen shapes", unseen), ("edge", edge)):
        errors = []
        for frame in rng.permutation(np.flatnonzero(mask[press] & (peak > 0.1)))[:count]:
            other = library[press[library] != press[frame]]
            distance = np.linalg.norm(window[other] - window[frame], axis=1)
            near = other[np.argpartition(distance, NEAREST)[:NEAREST]]
            gap = np.linalg.norm(window[near] - window[frame], axis=1)
            weight = (1.0 - gap / gap.max()) ** 1.5 + 1e-3
            design = np.column_stack([np.ones(NEAREST), window[near] - window[frame]])
            ridge = np.diag(np.append(0.0, np.full(design.shape[1] - 1, 0.05)))
            line = np.linalg.solve((design.T * weight) @ design + ridge, (design.T * weight) @ peak[near])
            errors.append(abs(line[0] - peak[frame]))
        found[name] = np.array(errors)
    return found


def _fitted(readings: PairReadings, counts: np.ndarray, spread: float, shape: Indenter, start: np.ndarray):
    """Return the least-squares fit of a shape's place, depth and yaw to readings."""
    middle = np.array([0.0, 0.0, 0.6, start[3]])
    return least_squares(
        lambda state: np.append((readings.of(state, shape) - counts) / spread, (state - middle) / PRIOR),
        start,
        method="lm",
        diff_step=1e-4,
        max_nfev=80,
    )


def _median(values: np.ndarray, weight: np.ndarray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def main() -> None:
    """Print median and 90th percentile of each limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solved", type=Path, nargs="?")
    parser.add_argument("--rig", type=int, default=60)
    parser.add_argument("--frames", type=int, default=60)
    given = parser.parse_args()
    rows = {"noise alone": of_noise(given.rig, given.frames, np.random.default_rng(given.rig))}
    if given.solved:
        frames = run.rig_frames(given.solved, given.rig)
        rows |= of_neighbours(frames, 4 * given.frames, np.random.default_rng(given.rig))
    for name, errors in rows.items():
        median, high = np.quantile(errors, [0.5, 0.9])
        print(f"rig {given.rig}, {name}: median {median:.4f} mm, 90th percentile {high:.4f} mm, {len(errors)} frames")


if __name__ == "__main__":
    main()
