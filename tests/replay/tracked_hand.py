"""Tracks of an emulated hand, as a perfect tracker and network would give them."""

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.demonstrations.paths.tracks_file import write_tracks
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.hand import DIRECTIONS

RATE = 30.0
COUNTS = 100.0
"""Reading of each taxel [counts per mm]."""


def tracks(folder, hand, task, digest, number=0):
    """Write the tracks of one grasp or wipe; return their file."""
    times = np.arange(int(8.4 * RATE)) / RATE
    found, count = {}, len(times)
    for name in DIRECTIONS:
        poses = np.array([hand.tip(name, t) for t in times])
        depth = np.array([hand.press(name, t)[2] for t in times], np.float32)
        found[name] = FingerTrack(
            name,
            "right",
            name,
            poses[:, :3, 3],
            Rotation.from_matrix(poses[:, :3, :3]).as_quat(),
            np.tile(1e-8 * np.eye(6), (count, 1, 1)),
            np.zeros(count, bool),
            count,
            0,
            np.repeat(COUNTS * depth, 24).reshape(count, 24),
            np.repeat(depth, 35 * 26).reshape(count, 35, 26),
        )
    network = {"hash": "f" * 64, "network": "none", "epoch": 0, "lookahead": 0, "sensor": "0"}
    name = f"episode-{number:06d}"
    made = Demonstration(
        f"{name}.mcap",
        digest,
        task,
        "table",
        RATE,
        np.rint(times * 1e9).astype(np.int64),
        found,
        dict.fromkeys(found, default_sensor()),
        {},
        network,
        (),
        {"made_by": "a test"},
    )
    path = folder / f"{name}.tracks.parquet"
    write_tracks(path, made)
    return path
