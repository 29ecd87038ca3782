"""How honest the stated standard deviations of cube poses are on rendered images, turned along pixel rows or at random.

Edges that run along the rows of pixels are the hard case: all of a pattern's edges then fall on the same fraction of a
pixel, so that errors of drawing do not average out. "outside" counts images of which a coordinate or an angle is
farther than 3 standard deviations from the truth.

    python benchmarks/cube_coverage.py [--seeds 30] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from cube_poses import CUBE, random_pose
from scipy.spatial.transform import Rotation

from tacdata.tags import detect_cube
from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import render_scene

INTRINSICS = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5}
TURNS = {"along rows, tilted by 30 deg": (150, 0, 0), "along rows, tilted by 45 deg": (135, 0, 0), "random": None}
"""Name -> Euler angles xyz from the cube to the camera [deg]; None for any."""
DISTANCES = (0.2, 0.3, 0.4)
"""[m]; tags are then 48, 32 and 24 px wide."""


def errors(turn, distance, seed):
    """Return error [rad, m] and stated standard deviation, shape (6,) each; None without a sure pose."""
    random = np.random.default_rng([seed, round(1000 * distance)])
    truth = random_pose(random, distance)
    truth[:2, 3] = random.uniform(-0.02, 0.02, 2)
    if turn is not None:
        truth[:3, :3] = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    image = render_scene([(truth, CUBE)], INTRINSICS, random, Look(rays=16))
    pose = detect_cube(image, INTRINSICS, CUBE)
    if pose is None or pose.ambiguous:
        return None
    turned = Rotation.from_matrix(pose.matrix[:3, :3] @ truth[:3, :3].T).as_rotvec()
    return np.concatenate([turned, pose.position - truth[:3, 3]]), np.sqrt(np.diag(pose.covariance))


def main():
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--json", type=Path)
    chosen, rows = parser.parse_args(), []
    print(f"{'':<30}{'distance':>9}{'images':>8}{'outside':>9}{'z error, median and worst':>28}{'stated':>9}")
    for name, turn in TURNS.items():
        for distance in DISTANCES:
            found = [pair for seed in range(chosen.seeds) if (pair := errors(turn, distance, seed)) is not None]
            off, spread = (np.array(part) for part in zip(*found, strict=True))
            outside = int((np.abs(off) > 3 * spread).any(axis=1).sum())
            deep = 1000 * np.abs(off[:, 5])
            rows.append(
                {
                    "turn": name,
                    "distance": distance,
                    "images": len(found),
                    "outside": outside,
                    "median_mm": float(np.median(deep)),
                    "worst_mm": float(deep.max()),
                    "stated_mm": float(1000 * np.median(spread[:, 5])),
                }
            )
            row = rows[-1]
            print(
                f"{name:<30}{distance:>7.1f} m{len(found):>8}{outside:>9}{row['median_mm']:>19.3f}, "
                f"{row['worst_mm']:.3f}{row['stated_mm']:>9.3f} mm",
                flush=True,
            )
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
