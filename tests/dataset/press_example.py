"""Synthetic episodes and labels for the tests of the dataset room."""

from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.dataset import frames
from tacdata.indenters.sphere import Sphere
from tacdata.labels import Label
from tacdata.plans import Press
from tacdata.recording.episode import CncStream, Episode, Phase, TaxelStream
from tacdata.sensor import Sensor, default_sensor

PERIOD = 33_333_333


def episode(number: int = 0, count: int = 20, sensor: Sensor | None = None, rest: bool = True) -> Episode:
    """A press with random readings; a fifth of the frames rests."""
    random = np.random.default_rng(100 + number)
    sensor = sensor or default_sensor()
    start = 1_760_000_000_000_000_000 + number * 10**12
    times = start + np.arange(count) * PERIOD
    ends = start + np.array([0, count // 5, 2 * count // 5, 3 * count // 5, 4 * count // 5, count]) * PERIOD
    names = ("rest", "approach", "press", "hold", "release")
    phases = tuple(Phase(n, int(a), int(b)) for n, a, b in zip(names, ends, ends[1:], strict=False))
    path_ns = np.array([start - PERIOD, ends[2], ends[3], ends[4], ends[5]])
    x, y = float(number), 0.5
    tip = np.array([[x, y, -1.0], [x, y, -0.3], [x, y, 1.2], [x, y, 1.2], [x, y, -1.0]])
    return Episode(
        path=Path(f"episode-{number:06d}.mcap"),
        press=Press(Sphere(2.0 + number), 1.2, x, y, hold=0.2, index=number, indenter_name=f"sphere{number % 2}"),
        sensor=sensor,
        rig={"name": "bench", "clock": {}},
        taxels=TaxelStream(
            times, times, np.arange(count) + 7, 5000 + 300 * random.random((count, sensor.taxels.count))
        ),
        cnc=CncStream(path_ns, path_ns, tip, ("Run",) * len(tip)),
        tags=(),
        phases=phases if rest else phases[1:],
        tip_ns=path_ns,
        tip=tip,
        complete=True,
        notes=("made for a test",),
    )


def label(of: Episode, **changes) -> Label:
    """A label with bulges (negative) and dents; every value is a float32 that a product by 1/1000 rounds."""
    random = np.random.default_rng(900 + of.number)
    count = len(of.taxels.sample_ns)
    signed = random.uniform(-0.4, 1.5, size=(count, *of.sensor.map.shape)).astype(np.float32)
    parents = {"sensor": of.sensor.content_hash, "recording": frames.recording_hash(of), "model": "c" * 64}
    values = {
        "episode": of.number,
        "time_ns": of.taxels.sample_ns,
        "tip": of.tip_at(of.taxels.sample_ns),
        "signed": signed,
        "taxel_force": random.random((count, of.sensor.taxels.count)).astype(np.float32),
        "taxel_closure": np.zeros((count, of.sensor.taxels.count), np.float32),
        "taxel_area": np.zeros((count, of.sensor.taxels.count), np.float32),
        "force": random.random((count, 3)).astype(np.float32),
        "error_map": np.full(signed.shape, 0.01, np.float16),
        "error": random.random(count).astype(np.float32),
        "force_error": np.full(count, 0.01, np.float32),
        "provenance": provenance.stamp("test", parents, {}),
    }
    return Label(**{**values, **changes})
