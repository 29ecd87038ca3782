"""Cost of opening a long recording with `tacdata view`: processor seconds, wall clock, streams drawn.

    python benchmarks/view_open.py --minutes 10 --rate 100

A press every six seconds is written by the recorder's own writer: 24 channels, a guide at 5 Hz, a camera at 30 Hz with
its tags' poses, clock models, and a label of distinct maps. Then the command runs in a process of its own, as a person
would run it; the first run after writing finds the file in the page cache, as it mostly is after recording.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts, TaxelFrame
from tacdata.indenters.sphere import Sphere
from tacdata.labels import Label, write_label
from tacdata.plans import Press
from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.clocks.envelope_fit import fit
from tacdata.recording.clocks.polled_clock import PolledClock
from tacdata.recording.files.writer import CubePoseRecord, EpisodeWriter, Header
from tacdata.recording.motion.move_times import Command
from tacdata.sensor import default_sensor

START = 1_760_000_000_000_000_000
PERIOD, DEEPEST = 6.0, 1.2
"""Seconds and depth of a press [s, mm]."""
LINK = 4_000_000
"""Delay of every stream [ns]."""
LENS = {"width": 640, "height": 480, "fx": 800.0, "fy": 800.0, "cx": 320.0, "cy": 240.0}
RIG = {
    "name": "made up",
    "registration": {"origin": [50.0, 40.0, -20.0], "yaw": 0.0},
    "cameras": {"top": {"intrinsics": LENS, "cube": {"side": 20.0, "tag": 16.0, "ids": {"+x": 0}}}},
}


def depth_at(seconds: np.ndarray) -> np.ndarray:
    """Return the commanded depth [mm], shape as ``seconds``: down, held, up, once a period."""
    corners = (0.0, 1.0, 2.0, 4.0, 5.0, PERIOD)
    return np.interp(seconds % PERIOD, corners, (-5.0, -5.0, DEEPEST, DEEPEST, -5.0, -5.0))


def pictures(count: int = 30) -> list[bytes]:
    """Return JPEG images of 640 x 480 with texture, about 35 kB each."""
    import cv2

    rng = np.random.default_rng(0)
    smooth = cv2.resize(rng.integers(60, 200, (60, 80, 3), dtype=np.uint8), (640, 480), interpolation=cv2.INTER_CUBIC)
    noisy = (np.clip(smooth + rng.normal(0, 3, smooth.shape), 0, 255).astype(np.uint8) for _ in range(count))
    return [cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes() for image in noisy]


def write(folder: Path, minutes: float, rate: float, camera_rate: float, labelled: bool) -> Path:
    """Write a recording, and its label if it is to have one; return the recording's path."""
    sensor = default_sensor()
    press = Press(Sphere(radius=4.0), DEEPEST, x=1.0, y=-0.5, speed=6.2, hold=2.0, indenter_name="ball")
    cameras = ("top",) if camera_rate else ()
    rig = RIG if cameras else {**RIG, "cameras": {}}
    controller = {"settings": {}, "acceleration": [200.0] * 3, "max_rate": [50.0] * 3}
    path = folder / "episode-000000.mcap"
    writer = EpisodeWriter(path, Header(press, sensor, rig, {}, {}, controller), Clock.start(), cameras=cameras)
    seconds = np.arange(int(60 * minutes * rate)) / rate
    time_ns, depth = START + np.rint(1e9 * seconds).astype(np.int64), depth_at(seconds)
    near = np.exp(-((sensor.taxels.centers - [1.0, -0.5]) ** 2).sum(axis=1) / 6.0)
    noise = np.random.default_rng(0).normal(0, 4, (len(seconds), 24))
    counts = np.rint(20_000 + 900 * np.maximum(depth, 0)[:, None] * near + noise)
    images, order = pictures(), np.arange(int(60 * minutes * camera_rate))
    exposed = START + np.rint(1e9 * order / max(camera_rate, 1)).astype(np.int64)
    taken = 0
    for k, at in enumerate(time_ns.tolist()):  # streams lie between each other, as a recorder writes them
        writer.taxels(TaxelFrame(at + LINK, k, counts[k]), at)
        if k % max(round(rate / 5), 1) == 0:
            tip = np.array([51.0, 39.5, -20.0 - depth[k]])
            writer.status(CncStatus(at - LINK // 2, at + LINK // 2, "Run", tip, 90.0))
        while taken < len(exposed) and exposed[taken] <= at:
            _image(writer, taken, int(exposed[taken]), images[taken % len(images)])
            taken += 1
        if k % 200 == 0:  # the writer refuses data that its thread cannot keep up with; a recorder is far slower
            time.sleep(0.12 if camera_rate else 0.005)
    _moves(writer, 60 * minutes)
    fits = {"taxels": fit(time_ns + LINK, np.arange(len(time_ns)), nominal_ns=1e9 / rate)}
    if cameras:
        fits["camera top"] = fit(exposed + LINK, order, "order")
    clocks: dict[str, ClockModel | PolledClock] = {name: model for name, model in fits.items() if model}
    writer.close(True, clock_models=clocks, counts={"taxels": StreamCounts(received=len(time_ns))})
    if not labelled:
        return path
    from tacdata.recording.files.reader import read_episode

    write_label(folder / "labels" / "episode-000000.parquet", made_label(read_episode(path)))
    return path


def _image(writer: EpisodeWriter, number: int, at: int, jpeg: bytes) -> None:
    writer.image("top", at + LINK, at, number, jpeg)
    writer.cube("top", at + LINK, at, number, CubePoseRecord((0.0, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0), 0.3, 2))


def _moves(writer: EpisodeWriter, seconds: float) -> None:
    names, corners = ("rest", "press", "hold", "release", ""), (0.0, 1.0, 2.0, 4.0, 5.0, PERIOD)
    for begun in np.arange(0, seconds - PERIOD + 1e-6, PERIOD):
        for name, a, b in zip(names, corners[:-1], corners[1:], strict=True):
            start, target = (np.array([51.0, 39.5, -20.0 - depth_at(np.array(t))]) for t in (a, b - 1e-9))
            sent, ends = (START + round(1e9 * (begun + t)) for t in (a, b))
            way = float(np.linalg.norm(target - start))
            if way < 1e-6:
                writer.motion(Command(name, start, target, 0.0, b - a, sent, ends, f"G4 P{b - a:g}"))
            else:
                writer.motion(Command(name, start, target, way / (b - a), 0.0, sent, sent + 1_000_000, "G1"))


def made_label(episode) -> Label:
    """Return a label of smooth dents, each frame's its own."""
    sensor, time_ns = episode.sensor, episode.taxels.sample_ns
    frames = len(time_ns)
    x, y = np.meshgrid(sensor.map.x, sensor.map.y, indexing="ij")
    shape = np.exp(-((x - 1.0) ** 2 + (y + 0.5) ** 2) / 4.0).astype(np.float32)
    deep = np.maximum(depth_at((time_ns - START) / 1e9), 0) + np.random.default_rng(1).normal(0, 1e-3, frames)
    none = np.zeros((frames, sensor.taxels.count), np.float32)
    parents = {"recording": "a" * 64, "sensor": sensor.content_hash, "model": "c" * 64}
    return Label(
        0,
        time_ns,
        np.column_stack([np.full(frames, 1.0), np.full(frames, -0.5), deep]),
        deep.astype(np.float32)[:, None, None] * shape,
        none,
        none,
        none,
        np.zeros((frames, 3), np.float32),
        np.full((frames, *shape.shape), 0.004, np.float16),
        np.full(frames, 0.004, np.float32),
        np.full(frames, 0.01, np.float32),
        provenance.stamp("benchmark", parents, {}),
    )


def opened(path: Path, target: Path) -> dict[str, float]:
    """Return wall clock, processor seconds and size of the file of `tacdata view PATH --save TARGET`."""
    command = [sys.executable, "-m", "tacdata.cli", "view", str(path), "--save", str(target)]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall s": wall, "cpu s": cpu, "rrd MB": target.stat().st_size / 1e6}


def main() -> None:
    """Write the recording, open it three times, print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=100.0, help="taxel frames a second")
    parser.add_argument("--camera-rate", type=float, default=30.0, help="images a second; 0: no camera")
    parser.add_argument("--unlabelled", action="store_true", help="no label: one of 1 kHz takes 4 GB to make")
    parser.add_argument("--folder", type=Path, help="keep the recording here, and use it again if it is there")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.folder or Path(temporary)
        path = folder / "episode-000000.mcap"
        if not path.is_file():
            write(folder, args.minutes, args.rate, args.camera_rate, not args.unlabelled)
        runs = [opened(path, Path(temporary) / f"{k}.rrd") for k in range(3)]
        from tacdata.viewers.source import scene_at

        scene = scene_at(path)
        drawn = {
            "frames": len(scene.frame_ns),
            "curve rows": max(len(c.time_ns) for c in scene.curves),
            "maps": len(scene.maps[0].time_ns) if scene.maps else 0,
            "images": sum(len(c.images) for c in scene.cameras),
            "recording MB": path.stat().st_size / 1e6,
        }
        for run in runs:
            print("  ".join(f"{name} {value:.2f}" for name, value in run.items()))
        print(json.dumps({"cores": os.cpu_count(), "load": os.getloadavg()[0], "drawn": drawn, "runs": runs}))


if __name__ == "__main__":
    main()
