"""A demonstration made of arrays: a hand from the virtual rig, seen by one or two cameras with noise."""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.paths.sightings import Sightings
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.demonstrations.recording.rig import demo_rig_of
from tacdata.recording.episode import TagStream, TaxelStream
from tacdata.virtual_rig.demo import FINGERS, INTRINSICS
from tacdata.virtual_rig.world.hand import draw_hand

HAND = draw_hand(1)
START = 1_700_000_000_000_000_000
NOISE = 0.0004, np.radians(0.3)


def rig(cameras=("eye",), fingers=FINGERS, boards=("thumb", "index", "middle"), **more):
    entry = {"driver": "opencv_camera", "source": 0, "intrinsics": INTRINSICS}
    world = {
        "version": "1.0",
        "frame": "table",
        "position": [0.0, 0.0, 0.0],
        "quaternion": [0.0, 0.0, 0.0, 1.0],
        "method": "none",
        "poses": 1,
        "residual": {"position": 0.0, "rotation": 0.0},
        "date": "",
        "code_version": "",
    }
    document = {
        "version": "1.0",
        "name": "bench",
        "fingers": fingers,
        "boards": {name: {"driver": "capacitive_board", "port": "x"} for name in boards},
        "cameras": {name: {**entry, "world": {**world, "camera": name}} for name in cameras},
        **more,
    }
    return demo_rig_of(document, "bench.yaml")


@cache
def tips(finger, times):
    """Frames of a fingertip at times [s] (a tuple), shape (n, 4, 4): most tests ask for the same."""
    frames = np.array([HAND.tip(finger, t) for t in times])
    frames.flags.writeable = False
    return frames


def view(finger, seconds=8.5, rate=25.0, camera="eye", seed=0, begin=0.0):
    rng = np.random.default_rng([seed, len(finger)])
    times = begin + np.arange(int(seconds * rate)) / rate
    truth = tips(finger, tuple(times))
    turns = Rotation.from_rotvec(rng.normal(0, NOISE[1], (len(times), 3))) * Rotation.from_matrix(truth[:, :3, :3])
    covariance = np.diag([NOISE[1] ** 2] * 3 + [NOISE[0] ** 2] * 3)
    first = FINGERS["fingers"][finger]["cube"]["ids"]["+x"]
    places = truth[:, :3, 3] + rng.normal(0, NOISE[0], (len(times), 3))
    return TagStream(
        camera,
        START + np.rint(times * 1e9).astype(np.int64),
        places,
        turns.as_quat(),
        np.full(len(times), 0.1),
        np.full(len(times), 2),
        np.tile(covariance, (len(times), 1, 1)),
        np.zeros(len(times), bool),
        ((first, first + 1),) * len(times),
        finger,
    )


def taxels(finger, seconds=8.5, rate=30.0):
    times = np.arange(int(seconds * rate)) / rate
    depth = np.array([HAND.press(finger, t)[2] for t in times])
    noise = np.random.default_rng(5).normal(0, 4, (len(times), 24))
    counts = 9000 + 1500 * depth[:, None] * np.linspace(0.5, 1.0, 24) + noise
    stamps, count = START + np.rint(times * 1e9).astype(np.int64), np.arange(len(times))
    return TaxelStream(stamps, stamps, count, np.round(counts))


def recording(tmp_path, views=None, streams=None, **options):
    path = Path(tmp_path) / "episode-000000.mcap"
    path.write_bytes(b"stand-in")
    names = tuple(FINGERS["fingers"])
    bench = rig(**options)
    made = tuple(view(name) for name in names) if views is None else views
    felt = {name: taxels(name) for name in bench.boards} if streams is None else streams
    return DemoRecording(path, bench, "grasp", felt, made, True, ())


def changed(stream, where, **values):
    """A stream with some rows of some arrays replaced."""
    arrays = {}
    for name, value in values.items():
        if name == "ids":
            arrays[name] = tuple(value if hit else old for hit, old in zip(where, stream.ids, strict=True))
        else:
            arrays[name] = getattr(stream, name).copy()
            arrays[name][where] = value if np.ndim(value) <= 1 or len(value) != len(where) else value[where]
    return TagStream(**{**vars(stream), **arrays})


def truth_at(finger, time_ns):
    return tips(finger, tuple((time_ns - START) * 1e-9))


__all__ = ["HAND", "NOISE", "START", "Sightings", "changed", "recording", "rig", "taxels", "truth_at", "view"]
