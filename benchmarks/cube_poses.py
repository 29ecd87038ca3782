"""Poses of AprilTag cubes against the truth of rendered images, and the cost of an image on one core.

    python benchmarks/cube_poses.py [--images 60] [--only clean,blur] [--json FILE]

A 20 mm cube with 16 mm tags (36h11) on five faces, f = 900 px, 1280 x 720, anywhere in view and turned at
random but for its mount. The images come from `tacdata.virtual_rig`, which shares no code with the detector.
No image has a hint from the one before, but for the rows "tracked". "wrong" counts poses turned by more than
3 degrees that are not marked as ambiguous. Milliseconds are CPU time with one OpenCV thread; nothing else
should run on the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata import provenance
from tacdata.tags import CubePose, FingerTracker, detect_cube, fingers_of
from tacdata.virtual_rig.optics.look import Look, Polygon
from tacdata.virtual_rig.optics.render import render_scene

INTRINSICS: dict[str, Any] = {"width": 1280, "height": 720, "fx": 900.0, "fy": 900.0, "cx": 639.5, "cy": 359.5}
LENS = {**INTRINSICS, "distortion": [-0.25, 0.06, 0.001, 0.001, 0.0]}
CUBE: dict[str, Any] = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}
FOLLOWED = 6
"""Sequences in which a cube is followed by one face [count]."""
FLIPPED = 3.0
"""Rotation error [deg] from which a pose counts as wrong."""


@dataclass(frozen=True)
class Condition:
    """How a set of images is taken."""

    look: Callable[[np.random.Generator, np.ndarray], Look]
    """Draws the look of an image whose cube has a pose, shape (4, 4) [m]."""
    distance: float = 0.4
    """[m]."""
    intrinsics: Any = None
    """Another camera than the default."""
    cube: Any = None
    """Another cube than the default."""


def pixel_of(pose: np.ndarray) -> np.ndarray:
    """Return about where a cube's centre is [px], shape (2,)."""
    return 900 * pose[:2, 3] / pose[2, 3] + (639.5, 359.5)


def cover(random: np.random.Generator, pose: np.ndarray, share: float) -> Look:
    """Cover about a share of the cube's outline from a random side with something grey, as a finger does."""
    along = random.uniform(0, 2 * np.pi)
    out, aside = np.array([np.cos(along), np.sin(along)]), np.array([-np.sin(along), np.cos(along)])
    size = 900 * 0.026 / pose[2, 3]
    edge = pixel_of(pose) + (0.5 - share) * size * out
    corners = (edge - size * aside, edge + size * aside, edge + size * (aside + out), edge + size * (out - aside))
    outline: Polygon = tuple((float(x), float(y)) for x, y in corners)
    return Look(covers=(outline,), cover=float(random.uniform(30, 200)))


def one_face(random: np.random.Generator, pose: np.ndarray, blur: float, noise: float) -> Look:
    """Cover every face in view but the one that looks most at the camera, as a palm or an object does."""
    turn, place = pose[:3, :3], pose[:3, 3]
    outs = {face: _out(face) for face in CUBE["ids"]}
    facing = {face: float(-(turn @ out) @ (place + 0.01 * turn @ out)) for face, out in outs.items()}
    kept = max(facing, key=lambda face: facing[face])
    covers = tuple(_outline(pose, outs[face]) for face, toward in facing.items() if toward > 0 and face != kept)
    return Look(blur=blur, noise=noise, covers=covers, cover=float(random.uniform(30, 200)))


def _out(face: str) -> np.ndarray:
    """Return a face's normal in the cube's frame [1], shape (3,)."""
    out = np.zeros(3)
    out["xyz".index(face[1])] = 1.0 if face[0] == "+" else -1.0
    return out


def _outline(pose: np.ndarray, out: np.ndarray) -> Polygon:
    """Return where a face of the cube is seen [px], a trifle smaller than it is, so that its neighbours stay whole."""
    axis = int(np.abs(out).argmax())
    first, second = (np.eye(3)[k] for k in range(3) if k != axis)
    corners = [0.01 * out + 0.0097 * (a * first + b * second) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    seen = [pose[:3, :3] @ corner + pose[:3, 3] for corner in corners]
    return tuple((float(900 * p[0] / p[2] + 639.5), float(900 * p[1] / p[2] + 359.5)) for p in seen)


def shadow(random: np.random.Generator, pose: np.ndarray) -> Look:
    """Let a sharp shadow's edge cross the cube."""
    along = random.uniform(0, 2 * np.pi)
    out, aside = np.array([np.cos(along), np.sin(along)]), np.array([-np.sin(along), np.cos(along)])
    middle = pixel_of(pose)
    corners = (middle - 400 * aside, middle + 400 * aside, middle + 400 * (aside + out), middle + 400 * (out - aside))
    return Look(shadow=tuple((float(x), float(y)) for x, y in corners))


def moving(random: np.random.Generator, reach: float) -> Look:
    """Move by ``reach`` [m] in a random direction, and turn by 2 degrees, while the shutter is open."""
    way = random.normal(size=3)
    turn = random.normal(size=3)
    way, turn = reach * way / np.linalg.norm(way), np.radians(2) * turn / np.linalg.norm(turn)
    return Look(shift=(way[0], way[1], way[2]), turn=(turn[0], turn[1], turn[2]))


def clutter(random: np.random.Generator) -> np.ndarray:
    """Return a crowded bench: boxes, lines, discs and letters, uint8, shape (720, 1280)."""
    import cv2

    image = np.full((720, 1280), 120, np.uint8)
    for _ in range(160):
        x, y = (int(value) for value in random.integers(0, (1280, 720)))
        grey, size = int(random.integers(0, 256)), int(random.integers(6, 90))
        kind = random.integers(4)
        if kind == 0:
            corners = cv2.boxPoints(((x, y), (size, int(random.integers(4, 90))), float(random.uniform(0, 90))))
            cv2.fillPoly(image, [corners.astype(np.int32)], grey, cv2.LINE_AA)
        elif kind == 1:
            cv2.circle(image, (x, y), size // 2, grey, -1 if random.random() < 0.5 else 3, cv2.LINE_AA)
        elif kind == 2:
            end = (x + int(random.integers(-200, 200)), y + int(random.integers(-200, 200)))
            cv2.line(image, (x, y), end, grey, int(random.integers(1, 6)), cv2.LINE_AA)
        else:
            cv2.putText(image, "tacdata 36h11"[: size // 7 + 1], (x, y), 0, size / 60, grey, 2, cv2.LINE_AA)
    return image


CONDITIONS = {
    "clean": Condition(lambda random, pose: Look()),
    "0.25 m": Condition(lambda random, pose: Look(), 0.25),
    "0.6 m": Condition(lambda random, pose: Look(), 0.6),
    "0.8 m": Condition(lambda random, pose: Look(), 0.8),
    "blur 1.0 px": Condition(lambda random, pose: Look(blur=1.0)),
    "blur 1.5 px": Condition(lambda random, pose: Look(blur=1.5)),
    "noise 5": Condition(lambda random, pose: Look(noise=5.0)),
    "noise 10": Condition(lambda random, pose: Look(noise=10.0)),
    "blur 1.2 px, noise 5": Condition(lambda random, pose: Look(blur=1.2, noise=5.0)),
    "moving 1 mm": Condition(lambda random, pose: moving(random, 0.001)),
    "moving 2 mm": Condition(lambda random, pose: moving(random, 0.002)),
    "covered 25 %": Condition(lambda random, pose: cover(random, pose, 0.25)),
    "covered 40 %": Condition(lambda random, pose: cover(random, pose, 0.4)),
    "all faces but one covered": Condition(lambda random, pose: one_face(random, pose, 0.7, 2.0)),
    "all faces but one covered, 1.2 px, noise 5": Condition(lambda random, pose: one_face(random, pose, 1.2, 5.0)),
    "light falls to 20 %": Condition(lambda random, pose: Look(fall=0.8)),
    "sharp shadow": Condition(shadow),
    "dark, gain 0.25": Condition(lambda random, pose: Look(gain=0.25)),
    "overexposed, gain 1.4": Condition(lambda random, pose: Look(gain=1.4)),
    "distorting lens": Condition(lambda random, pose: Look(), intrinsics=LENS),
    "JPEG 75": Condition(lambda random, pose: Look(jpeg=75)),
    "JPEG 40": Condition(lambda random, pose: Look(jpeg=40)),
    "crowded bench": Condition(lambda random, pose: Look(background=clutter(random))),
    "one face only": Condition(lambda random, pose: Look(), cube={**CUBE, "ids": {"+z": 4}}),
    "all: 1.0 px, noise 5, JPEG 75, covered 25 %, crowded": Condition(
        lambda random, pose: Look(
            blur=1.0, noise=5.0, jpeg=75, covers=cover(random, pose, 0.25).covers, background=clutter(random)
        )
    ),
}


def random_pose(random: np.random.Generator, distance: float) -> np.ndarray:
    """Return a pose, shape (4, 4) [m], in view, whose mount is not turned to the camera."""
    while True:
        rotation = Rotation.random(rng=random).as_matrix()
        if rotation[2, 2] < 0.3:
            break
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = distance * np.array([random.uniform(-0.5, 0.5), random.uniform(-0.25, 0.25), 1])
    return pose


def errors(pose: CubePose, truth: np.ndarray) -> tuple[float, float]:
    """Return the position error [mm] and the rotation error [deg]."""
    turn = Rotation.from_matrix(pose.matrix[:3, :3].T @ truth[:3, :3]).magnitude()
    return float(1000 * np.linalg.norm(pose.position - truth[:3, 3])), float(np.degrees(turn))


def cost_of[T](work: Callable[[], T]) -> tuple[T, float]:
    """Return a result and its cost [ms of CPU]."""
    begun = time.process_time()
    result = work()
    return result, 1000 * (time.process_time() - begun)


def accuracy(condition: Condition, images: int, seed: int = 0) -> dict[str, float]:
    """Return the figures of one condition."""
    random, rows, milliseconds = np.random.default_rng(seed), [], []
    camera, cube = condition.intrinsics or INTRINSICS, condition.cube or CUBE
    for _ in range(images):
        truth = random_pose(random, condition.distance)
        image = render_scene([(truth, cube)], camera, random, condition.look(random, truth))
        pose, spent = cost_of(partial(detect_cube, image, camera, cube))
        milliseconds.append(spent)
        if pose is not None:
            rows.append((*errors(pose, truth), pose.ambiguous))
    found = np.array(rows, float).reshape(-1, 3)
    wrong = (found[:, 1] > FLIPPED) & (found[:, 2] == 0)
    figures: dict[str, float] = {"images": images, "found": len(found), "ms": float(np.median(milliseconds))}
    if len(found):
        for name, column in (("position", found[:, 0]), ("rotation", found[:, 1])):
            figures |= {f"{name}_median": float(np.median(column)), f"{name}_p95": float(np.percentile(column, 95))}
    return figures | {"ambiguous": int(found[:, 2].sum()), "wrong": int(wrong.sum())}


def followed(images: int, seed: int) -> dict[str, float]:
    """Return how a tracker follows a cube of which one face stays visible: errors, and jumps between its two poses.

    Blur 1.2 px, noise 5. A jump is a change from image to image that differs from the true one by more than `FLIPPED`.
    """
    random = np.random.default_rng([seed, 4])
    begin, axis = random_pose(random, 0.4), random.normal(size=3)
    axis, rows, last = axis / np.linalg.norm(axis), [], None
    tip = {"position": [0.0, 0.0, 0.0], "quaternion": [0.0, 0.0, 0.0, 1.0]}
    document = {"version": "1.0", "fingers": {"index": {"cube": CUBE, "tip": tip}}}
    tracker = FingerTracker(INTRINSICS, fingers_of(document))
    for step in range(images):
        truth = begin.copy()
        truth[:3, :3] = Rotation.from_rotvec(np.radians(40) * np.sin(0.05 * step) * axis).as_matrix() @ begin[:3, :3]
        truth[0, 3] += 0.02 * np.sin(0.1 * step)
        image = render_scene([(truth, CUBE)], INTRINSICS, random, one_face(random, truth, 1.2, 5.0))
        cube = tracker.update(image).cubes.get("index")
        if cube is None:
            last = None
            continue
        off = Rotation.from_matrix(cube.matrix[:3, :3] @ truth[:3, :3].T)
        jumped = last is not None and np.degrees((off * last.inv()).magnitude()) > FLIPPED
        last = off
        rows.append((*errors(cube, truth), float(jumped), float(cube.ambiguous)))
    found = np.array(rows, float).reshape(-1, 4)
    wrong = (found[:, 1] > FLIPPED) & (found[:, 3] == 0)
    figures: dict[str, float] = {"images": images, "found": len(found), "jumps": int(found[:, 2].sum())}
    return figures | {"ambiguous": int(found[:, 3].sum()), "wrong": int(wrong.sum())}


def costs(images: int) -> Iterator[tuple[str, float]]:
    """Yield a description of the images and their cost [ms of CPU, median]."""
    random = np.random.default_rng(1)
    aside = {"position": [0.0, -12.0, 0.0], "quaternion": [0.0, 0.0, 0.0, 1.0]}
    names = ("thumb", "index", "middle")
    cubes = {n: {**CUBE, "ids": {face: 5 * k + i for face, i in CUBE["ids"].items()}} for k, n in enumerate(names)}
    document = {"version": "1.0", "fingers": {n: {"cube": c, "tip": aside} for n, c in cubes.items()}}
    fingers = fingers_of(document)
    for bench in ("empty", "crowded"):
        background = None if bench == "empty" else clutter(random)
        for count in (0, 1, 3):
            starts = [random_pose(random, 0.4) for _ in range(count)]
            for k, pose in enumerate(starts):
                pose[0, 3] = 0.12 * (k - 1)
            tracker, spent = FingerTracker(INTRINSICS, fingers), []
            for step in range(images):
                scene = []
                for name, pose in zip(names[:count], starts, strict=True):
                    now = pose.copy()
                    now[0, 3] += 0.02 * np.sin(0.1 * step)
                    scene.append((now, cubes[name]))
                image = render_scene(scene, INTRINSICS, random, Look(background=background))
                spent.append(cost_of(partial(tracker.update, image))[1])
            yield f"tracked: {count} cubes, {bench} bench", float(np.median(spent))


def main() -> None:
    """Measure, print two tables and one line of JSON."""
    import cv2

    described = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=described)
    parser.add_argument("--images", type=int, default=60, help="images a condition")
    parser.add_argument("--only", help="conditions whose names begin so, with commas between")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    wanted = tuple(options.only.split(",")) if options.only else ("",)
    cv2.setNumThreads(1)
    detect_cube(render_scene([], INTRINSICS, np.random.default_rng(0)), INTRINSICS, CUBE)
    figures = {}
    print(f"{'':<54}{'found':>8}{'position [mm]':>18}{'rotation [deg]':>18}{'ambig.':>8}{'wrong':>7}{'ms':>7}")
    for name in (name for name in CONDITIONS if name.startswith(wanted)):
        row = figures[name] = accuracy(CONDITIONS[name], options.images)
        position, rotation = (
            f"{row.get(f'{what}_median', np.nan):.3f} / {row.get(f'{what}_p95', np.nan):.3f}"
            for what in ("position", "rotation")
        )
        print(
            f"{name:<54}{row['found']:>4}/{row['images']:<3}{position:>18}{rotation:>18}"
            f"{row['ambiguous']:>8}{row['wrong']:>7}{row['ms']:>7.1f}",
            flush=True,
        )
    for seed in range(FOLLOWED) if not options.only or "followed".startswith(wanted) else ():
        row = figures[f"followed {seed}"] = followed(2 * options.images, seed)
        print(
            f"followed by one face, {seed}: " + ", ".join(f"{key} {value:g}" for key, value in row.items()), flush=True
        )
    for name, milliseconds in costs(30) if not options.only else ():
        figures[name] = milliseconds
        print(f"{name:<54}{milliseconds:>70.1f}", flush=True)
    result = {
        "benchmark": "cube_poses",
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "code_version": provenance.code_version(),
        "figures": figures,
    }
    if options.json:
        options.json.write_text(json.dumps(result, indent=1))
    print(json.dumps(result))


if __name__ == "__main__":
    main()
