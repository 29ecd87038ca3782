"""How honest fingertip paths are: right sightings left out, and truth inside the stated standard deviations.

A hand grasps or wipes, seen by two cameras at 20 Hz. Sightings scatter by their stated covariance. Each camera's place
is off by a constant error of its stated spread. Now and then a sighting is mirrored, or the finger is hidden.

A hand's movement is cut into `--starts` starting moments. Each seed takes `--moments` of them, evenly spread and
shifted from seed to seed, so that all seeds together take every moment.

    python benchmarks/hand_paths.py [--seeds N] [--starts N] [--moments N] [--seconds S] [--mirrored SHARE]
        [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.demonstrations.paths.acquisition import acquire
from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.path_faults import gaps
from tacdata.demonstrations.paths.sightings import sightings_of
from tacdata.demonstrations.recording.rig import demo_rig_of
from tacdata.recording.episode import TagStream
from tacdata.virtual_rig.demo import AIM, EYES, FINGERS, INTRINSICS
from tacdata.virtual_rig.optics.scene import looking_at
from tacdata.virtual_rig.world.hand import PERIOD, TASKS, draw_hand

SPREAD = 0.0002, float(np.radians(0.03))
"""Standard deviation of each camera's place [m] and rotation [rad], as the rig file states it."""
RATE = 20.0
"""Images a second and camera [Hz]."""
FRAMES = 30.0
"""Rate of the path's grid [Hz]."""
START = 1_700_000_000_000_000_000


def rig_of(seed):
    """Return a demo rig whose cameras are a little off the poses in its file, and their true poses."""
    rng = np.random.default_rng([seed, 13])
    cameras, truth = {}, {}
    for name, place in EYES.items():
        pose = looking_at(place, AIM)
        turn = Rotation.from_rotvec(rng.normal(0, SPREAD[1], 3)) * Rotation.from_matrix(pose[:3, :3])
        truth[name] = pose
        cameras[name] = {
            "driver": "opencv_camera",
            "source": 0,
            "intrinsics": dict(INTRINSICS),
            "world": {
                "version": "1.0",
                "camera": name,
                "frame": "table",
                "position": (pose[:3, 3] + rng.normal(0, SPREAD[0], 3)).tolist(),
                "quaternion": turn.as_quat().tolist(),
                "method": "virtual board",
                "poses": 1,
                "residual": {"position": SPREAD[0], "rotation": SPREAD[1]},
                "spread": {"position": SPREAD[0], "rotation": SPREAD[1]},
                "date": "2026-01-01",
                "code_version": "",
            },
        }
    document = {
        "version": "1.0",
        "name": "bench",
        "fingers": FINGERS,
        "boards": {n: {"driver": "capacitive_board", "port": "x"} for n in FINGERS["fingers"]},
        "cameras": cameras,
    }
    return demo_rig_of(document, "bench.yaml"), truth


def view(hand, finger, camera, eye, begin, seconds, rng, mirrored, hidden):
    """Return one camera's view of a finger; noise differs from image to image as the face turns away."""
    times = begin + np.arange(int(seconds * RATE)) / RATE + rng.uniform(0, 1 / RATE)
    world = np.linalg.inv(eye)
    poses = np.array([world @ hand.tip(finger, t) for t in times])
    count = len(times)
    # Across the line of sight a tag is known ten times as well as along it.
    across = rng.uniform(0.00005, 0.0002, count)
    spreads = np.stack([np.radians(0.25) * np.ones(count)] * 3 + [across, across, 6 * across], axis=1)
    noise = rng.normal(0, spreads)
    turns = Rotation.from_rotvec(noise[:, :3]) * Rotation.from_matrix(poses[:, :3, :3])
    covariance = np.zeros((count, 6, 6))
    covariance[:, range(6), range(6)] = spreads**2
    is_mirrored = rng.random(count) < mirrored
    angles = Rotation.from_rotvec(np.radians(50) * np.array([1.0, 0, 0]))
    turns = Rotation.concatenate([t * angles if m else t for t, m in zip(turns, is_mirrored, strict=True)])
    position = poses[:, :3, 3] + noise[:, 3:]
    position[is_mirrored] += 0.015
    seen = ~((times - begin > hidden[0]) & (times - begin < hidden[1])) & (rng.random(count) < 0.9)
    first = FINGERS["fingers"][finger]["cube"]["ids"]["+x"]
    stream = TagStream(
        camera,
        START + np.rint((times - begin) * 1e9).astype(np.int64)[seen],
        position[seen],
        turns.as_quat()[seen],
        np.full(count, 0.1)[seen],
        np.full(count, 2)[seen],
        covariance[seen],
        np.zeros(count, bool)[seen],
        ((first, first + 1),) * int(seen.sum()),
        finger,
    )
    return stream, is_mirrored[seen]


def judged(seed, task, begin, seconds, mirrored):
    """Return one finger's figures: right sightings left out, frames and those outside of 3 standard deviations."""
    rng = np.random.default_rng([seed, round(1000 * begin), 7])
    hand = draw_hand(seed, task)
    rig, eyes = rig_of(seed)
    finger = ("thumb", "index", "middle")[seed % 3]
    start = rng.uniform(2, seconds - 3)
    hidden = (start, start + rng.choice([0.0, 0.5, 1.0]))
    made = [view(hand, finger, name, eye, begin, seconds, rng, mirrored, hidden) for name, eye in eyes.items()]
    streams, bad = [m[0] for m in made], np.concatenate([m[1] for m in made])
    order = np.argsort(np.concatenate([s.sample_ns for s in streams]), kind="stable")
    seen, bad = sightings_of(finger, streams, rig), bad[order]
    times = START + np.rint(np.arange(int(seconds * FRAMES)) / FRAMES * 1e9).astype(np.int64)
    path = acquire(seen, times, choose(seen))
    inside = np.isfinite(path.position).all(axis=1)
    truth = np.array([hand.tip(finger, begin + (t - START) * 1e-9) for t in times[inside]])
    off = path.position[inside] - truth[:, :3, 3]
    spread = np.sqrt(path.covariance[inside][:, range(3, 6), range(3, 6)])
    turns = Rotation.from_matrix(truth[:, :3, :3] @ path.rotation[inside].transpose(0, 2, 1)).as_rotvec()
    turned = np.sqrt(path.covariance[inside][:, range(3), range(3)])
    bridged = np.zeros(len(times), bool)
    for a, b in gaps(seen.time_ns[path.accepted], int(times[0]), int(times[-1])):
        bridged |= (times > a) & (times < b)
    outside = (np.abs(off) > 3 * spread).any(axis=1) | (np.abs(turns) > 3 * turned).any(axis=1)
    return {
        "right": int((~bad).sum()),
        "right_left_out": int((~bad & ~path.accepted).sum()),
        "mirrored": int(bad.sum()),
        "mirrored_left_out": int((bad & ~path.accepted).sum()),
        "frames": int(inside.sum()),
        "outside": int(outside.sum()),
        "bridged": int(bridged[inside].sum()),
        "outside_bridged": int((outside & bridged[inside]).sum()),
        "error_mm": float(1000 * np.median(np.linalg.norm(off, axis=1))),
        "stated_mm": float(1000 * np.median(np.linalg.norm(spread, axis=1))),
        "worst_mm": float(1000 * np.linalg.norm(off, axis=1).max()),
    }


def moments(seed, starts, taken):
    """Return the starting moments [s] that a seed takes."""
    return [PERIOD * ((seed + round(k * starts / taken)) % starts) / starts for k in range(taken)]


def main():
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--moments", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=18.0)
    parser.add_argument("--mirrored", type=float, default=0.01)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    rows = {task: [] for task in TASKS}
    # All seeds come before the next moment, so that a run that is broken off has seen every seed.
    for k, seed in product(range(chosen.moments), range(chosen.seeds)):
        for task, own in rows.items():
            begin = moments(seed, chosen.starts, chosen.moments)[k]
            own.append(judged(seed, task, begin, chosen.seconds, chosen.mirrored))
            if chosen.json:
                chosen.json.write_text(json.dumps(rows, indent=1) + "\n")
    for task, own in rows.items():
        report(task, own, chosen.seconds)


def report(task, rows, seconds):
    """Print the figures of all recordings of a task."""
    total = {key: sum(row[key] for row in rows) for key in rows[0] if not key.endswith("_mm")}
    worst = max(row["right_left_out"] / row["right"] for row in rows)
    uncovered = np.array([row["outside"] / row["frames"] for row in rows])
    print(f"{task}: {len(rows)} recordings of {seconds:g} s")
    print(
        f"  right sightings left out   {total['right_left_out'] / total['right']:.2%}, worst {worst:.2%}, "
        f"above 1 % in {sum(row['right_left_out'] > 0.01 * row['right'] for row in rows)}"
    )
    print(f"  mirrored ones left out     {total['mirrored_left_out']} of {total['mirrored']}")
    print(
        f"  frames outside of 3 sd     {total['outside'] / total['frames']:.2%}, worst {uncovered.max():.2%}, "
        f"above 1 % in {(uncovered > 0.01).sum()}"
    )
    print(f"  the same in gaps           {total['outside_bridged']} of {total['bridged']}")
    error, stated = (np.median([row[key] for row in rows]) for key in ("error_mm", "stated_mm"))
    print(f"  error, stated [mm]         {error:.3f}, {stated:.3f}; worst {max(r['worst_mm'] for r in rows):.1f}")


if __name__ == "__main__":
    main()
