"""A small learnable world: a blob whose depth map is a linear mixture of what 24 signals carry."""

import numpy as np

from tacdata.recording.episode import PHASES
from tacdata.sensor import default_sensor
from tacdata.training.frames.frames import EpisodeSpan, Frames

SHAPES = ("sphere", "cylinder", "cone")


def build_frames(episodes: int = 12, length: int = 24, seed: int = 0) -> Frames:
    """Presses at random sites; each taxel reads the blob's depth at its centre, plus noise, minus nothing."""
    sensor = default_sensor()
    generator = np.random.default_rng(seed)
    x, y = np.meshgrid(sensor.map.x, sensor.map.y, indexing="ij")
    spans, depth, tip, phase, taxels, force = [], [], [], [], [], []
    for number in range(episodes):
        cx, cy, deepest = generator.uniform(-4, 4), generator.uniform(-3, 3), generator.uniform(0.8, 1.6)
        rest, ramp = length // 6, length // 4
        course = np.concatenate(
            [
                np.zeros(rest),
                np.linspace(0, deepest, ramp),
                np.full(length - rest - 2 * ramp, deepest),
                np.linspace(deepest, 0, ramp),
            ]
        )
        marks = np.repeat(
            [PHASES.index(p) for p in ("rest", "press", "hold", "release")],
            [rest, ramp, length - rest - 2 * ramp, ramp],
        )
        blob = np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * 1.5**2))
        at_taxels = np.exp(-((sensor.taxels.centers - (cx, cy)) ** 2).sum(axis=1) / (2 * 1.5**2))
        depth.append(course[:, None, None] * blob)
        taxels.append(1000 * course[:, None] * at_taxels + generator.normal(0, 2, (length, 24)))
        force.append(0.2 * (course[:, None] * at_taxels) ** 1.5)
        tip.append(np.stack([np.full(length, cx), np.full(length, cy), course], axis=1))
        phase.append(marks)
        shape = SHAPES[number % 3]
        place = number, number * length, (number + 1) * length
        speed, specimen = 0.5 + 0.1 * (number % 7), f"specimen {number % 4}"
        spans.append(EpisodeSpan(*place, f"{shape}_2", shape, cx, cy, deepest, speed, specimen))
    n = episodes * length
    return Frames(
        taxels=np.concatenate(taxels).astype(np.float32),
        depth=np.concatenate(depth).astype(np.float32),
        tip=np.concatenate(tip).astype(np.float32),
        phase=np.concatenate(phase),
        time_ns=np.tile(np.arange(length) * 33_333_333, episodes),
        valid=np.ones(n, dtype=bool),
        episodes=tuple(spans),
        sensor=sensor,
        dataset_hash="d" * 64,
        origin="synthetic",
        virtual=True,
        taxel_force=np.concatenate(force).astype(np.float32),
    )
