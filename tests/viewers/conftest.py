"""A press that never happened: arrays with known values, so that every picture can be held against them."""

from pathlib import Path

import numpy as np
import pytest

from tacdata import provenance
from tacdata.indenters.sphere import Sphere
from tacdata.labels import Label
from tacdata.plans import Press
from tacdata.recording.episode import CncStream, Episode, Phase, TagStream, TaxelStream
from tacdata.sensor import default_sensor
from tacdata.training.inference.prediction import PredictedMaps

START = 1_760_000_000_000_000_000
FRAMES, RATE = 120, 30.0
DEEPEST = 1.2
RIG = {
    "name": "paper rig",
    "registration": {"origin": [50.0, 40.0, -20.0], "yaw": 90.0},
    "cameras": {
        "top": {
            "intrinsics": {"width": 320, "height": 240, "fx": 400.0, "fy": 400.0, "cx": 160.0, "cy": 120.0},
            "cube": {"side": 20.0, "tag": 16.0, "ids": {"+x": 0}},
        }
    },
}


def tip_path():
    """Return times [ns] and x, y, depth [mm] of a press that comes down, holds and goes up."""
    seconds = np.array([0.0, 1.0, 1.5, 2.3, 2.9, 3.6, 4.0])
    depth = np.array([-5.0, -5.0, 0.0, DEEPEST, DEEPEST, 0.0, -5.0])
    return START + (1e9 * seconds).astype(np.int64), np.column_stack([np.full(7, 1.0), np.full(7, -0.5), depth])


def dent(sensor, tip):
    """Return a signed map [mm], shape (n, 35, 26): a smooth dent under the tip with a low rim around it."""
    x, y = np.meshgrid(sensor.map.x, sensor.map.y, indexing="ij")
    square = (x - tip[:, 0, None, None]) ** 2 + (y - tip[:, 1, None, None]) ** 2
    deep = np.maximum(tip[:, 2], 0.0)[:, None, None]
    return (deep * (np.exp(-square / 4.0) - 0.08 * np.exp(-((np.sqrt(square) - 4.0) ** 2)))).astype(np.float32)


def made(episode):
    """Return the provenance that a label or prediction file must carry."""
    parents = {"recording": "a" * 64, "sensor": episode.sensor.content_hash, "model": "c" * 64}
    return provenance.stamp("test", parents, {})


@pytest.fixture(scope="session")
def episode():
    sensor = default_sensor()
    press = Press(Sphere(radius=4.0), DEEPEST, x=1.0, y=-0.5, speed=1.5, hold=0.6, index=3, indenter_name="ball")
    time = START + (np.arange(FRAMES) * 1e9 / RATE).astype(np.int64)
    tip_ns, tip = tip_path()
    at = np.stack([np.interp(time, tip_ns, tip[:, k]) for k in range(3)], axis=-1)
    near = np.exp(-((sensor.taxels.centers - [1.0, -0.5]) ** 2).sum(axis=1) / 6.0)
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 4, (FRAMES, 24))
    counts = 20_000 + 300 * np.arange(24) + 900 * np.maximum(at[:, 2:], 0) * near + noise
    reports = time[::4]
    reported = np.stack([np.interp(reports, tip_ns, tip[:, k]) for k in range(3)], axis=-1)
    x, y, depth = reported.T
    machine = np.column_stack([50 - y, 40 + x, -20 - depth])
    half = np.linspace(0, 0.4, len(reports))
    position = np.column_stack([0.01 * np.sin(half), np.zeros(len(reports)), np.full(len(reports), 0.2)])
    position[5:8] = np.nan
    quaternion = np.column_stack([np.sin(half) * 0.8, np.sin(half) * 0.6, np.zeros(len(half)), np.cos(half)])
    ends = START + (1e9 * np.array([0.0, 1.0, 1.5, 2.3, 2.9, 3.6])).astype(np.int64)
    names = ("rest", "approach", "press", "hold", "release")
    return Episode(
        path=Path("session/episode-000003.mcap"),
        press=press,
        sensor=sensor,
        rig=RIG,
        taxels=TaxelStream(time + 4_000_000, time, np.arange(500, 500 + FRAMES), counts),
        cnc=CncStream(reports + 3_000_000, reports, machine, ("Run",) * len(reports)),
        tags=(
            TagStream(
                "top",
                reports,
                position,
                quaternion,
                np.full(len(reports), 0.3),
                np.where(np.isnan(position[:, 0]), 0, 2),
            ),
        ),
        phases=tuple(Phase(n, int(a), int(b)) for n, a, b in zip(names, ends[:-1], ends[1:], strict=True)),
        tip_ns=tip_ns,
        tip=tip,
        complete=True,
        notes=("a made-up press",),
    )


@pytest.fixture(scope="session")
def label(episode):
    tip = episode.tip_at(episode.taxels.sample_ns)
    signed = dent(episode.sensor, tip)
    force = np.column_stack([np.zeros((FRAMES, 2)), 2 * np.maximum(tip[:, 2], 0)]).astype(np.float32)
    return Label(
        episode=3,
        time_ns=episode.taxels.sample_ns,
        tip=tip,
        signed=signed,
        taxel_force=np.zeros((FRAMES, 24), np.float32),
        taxel_closure=np.zeros((FRAMES, 24), np.float32),
        taxel_area=np.zeros((FRAMES, 24), np.float32),
        force=force,
        error_map=np.full(signed.shape, 0.004, np.float16),
        error=np.full(FRAMES, 0.004, np.float32),
        force_error=np.full(FRAMES, 0.01, np.float32),
        provenance=made(episode),
    )


@pytest.fixture(scope="session")
def prediction(label, episode):
    tip = label.tip + np.array([0.4, 0.2, 0.0])
    depth = np.maximum(0.9 * dent(episode.sensor, tip), 0)
    return PredictedMaps(
        episode=0,
        time_ns=label.time_ns[2:],
        depth=depth[2:],
        part="test",
        checkpoint="ab" * 32,
        network="tacprint",
        dataset="cd" * 32,
        sensor=episode.sensor.content_hash,
        provenance=made(episode),
    )


@pytest.fixture(scope="session")
def images(episode):
    """Images of the camera "top" with the cube drawn as a grey square where it is."""
    import cv2

    stream, taken = episode.tags[0], []
    for k, time in enumerate(stream.sample_ns):
        picture = np.full((240, 320, 3), 205, np.uint8)
        cv2.rectangle(picture, (120 + k, 85), (200 + k, 160), (90, 90, 90), -1)
        taken.append(("top", int(time), cv2.imencode(".jpg", picture)[1].tobytes()))
    return taken
