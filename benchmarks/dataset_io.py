"""Datasets written and read: frames and nine-frame windows a second, ours and lerobot's, in one run.

    python benchmarks/dataset_io.py [--episodes 20] [--frames 300] [--large 100] [--json FILE]

Both write the same frames, all columns with full statistics, the 35 x 26 map as a float32 depth image.
Windows are drawn at random, with the map of their middle frame. "cold maps" is the first opening, which
decodes the Parquet files once; after it the maps come from the page cache. Nothing else should run on the
machine.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.dataset import frames, pack, read_dataset
from tacdata.dataset.format import features
from tacdata.indenters import from_document
from tacdata.labels import Label
from tacdata.plans import Press
from tacdata.recording.episode import CncStream, Episode, Phase, TaxelStream
from tacdata.sensor import Sensor, default_sensor

RATE = 30


def episode(number: int, count: int, sensor: Sensor) -> Episode:
    """Return a press with noisy readings."""
    random = np.random.default_rng(number)
    times = number * 10**12 + np.arange(count) * (10**9 // RATE)
    counts = random.normal(5000, 30, (count, sensor.taxels.count))
    tip = np.stack([np.zeros(count), np.zeros(count), np.linspace(-1, 1.5, count)], axis=1)
    press = Press(
        from_document({"shape": "sphere", "radius": 3.0}), 1.5, hold=0.1, index=number, indenter_name="sphere"
    )
    return Episode(
        path=Path(f"episode-{number:06d}.mcap"),
        press=press,
        sensor=sensor,
        rig={"name": "none"},
        taxels=TaxelStream(times, times, np.arange(count), counts),
        cnc=CncStream(times, times, tip, ("Run",) * count),
        tags=(),
        phases=(Phase("rest", int(times[0]), int(times[count // 4])),),
        tip_ns=times,
        tip=tip,
        complete=True,
        notes=(),
    )


def label(of: Episode) -> Label:
    """Return a smooth dent that deepens, with the noise of a float32."""
    sensor, count = of.sensor, len(of.taxels.sample_ns)
    x, y = np.meshgrid(sensor.map.x, sensor.map.y, indexing="ij")
    dent = np.exp(-(x**2 + y**2) / 4) - 0.1
    parents = {"sensor": sensor.content_hash, "recording": frames.recording_hash(of), "model": "0" * 64}
    return Label(
        episode=of.number,
        time_ns=of.taxels.sample_ns,
        tip=of.tip,
        signed=(of.tip[:, 2, None, None] * dent).astype(np.float32),
        taxel_force=np.ones((count, sensor.taxels.count), np.float32),
        force=np.ones((count, 3), np.float32),
        taxel_closure=np.ones((count, sensor.taxels.count), np.float32),
        taxel_area=np.ones((count, sensor.taxels.count), np.float32),
        error_map=np.full((count, *sensor.map.shape), 0.01, np.float16),
        error=np.full(count, 0.01, np.float32),
        force_error=np.full(count, 0.01, np.float32),
        provenance=provenance.stamp("benchmark", parents, {}),
    )


def seconds(work: Callable[[], object]) -> float:
    """Return how long ``work`` takes [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def rate_of(work: Callable[[], int], at_least: float = 2.0) -> float:
    """Return how many things a second ``work`` does, called until ``at_least`` seconds are over."""
    work()
    done, start = 0, time.perf_counter()
    while time.perf_counter() - start < at_least:
        done += work()
    return done / (time.perf_counter() - start)


def write_by_lerobot(root: Path, pairs: list[tuple[Episode, Label]]) -> None:
    """Write the episodes through add_frame."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    sensor = pairs[0][0].sensor
    described = features.lerobot_features(sensor)
    own = {key: {**described[key], "shape": tuple(described[key]["shape"])} for key in features.DTYPES}
    dataset = LeRobotDataset.create("local/benchmark", RATE, own, root=root, use_videos=False)
    for each, its_label in pairs:
        columns = {key: features.cast(key, v) for key, v in frames.episode_columns(each, its_label).items()}
        columns[features.DEPTH] = (columns[features.DEPTH] / np.float32(1000))[..., None]
        count = len(each.taxels.sample_ns)
        columns[features.SENSOR] = columns[features.RECORD] = np.ones(count, np.int64)
        for frame in range(count):
            dataset.add_frame({**{k: np.atleast_1d(v[frame]) for k, v in columns.items()}, "task": "press"})
        dataset.save_episode()
    dataset.finalize()


def measure(work: Path, episodes: int, count: int, large: int) -> Iterator[tuple[str, float, str]]:
    """Yield name, value and unit of each figure."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    from tacdata.dataset.windows import WindowDataset, centred

    sensor = default_sensor()
    pairs = [(e, label(e)) for e in (episode(n, count, sensor) for n in range(episodes))]
    labels = {e.number: its_label for e, its_label in pairs}
    total = episodes * count

    def write_ours() -> None:
        shutil.rmtree(work / "ours", ignore_errors=True)
        pack([e for e, _ in pairs], lambda e: labels[e.number], work / "ours")

    yield ("write, lerobot add_frame", total / seconds(lambda: write_by_lerobot(work / "theirs", pairs)), "frames/s")
    yield "write, ours", total / min(seconds(write_ours) for _ in range(3)), "frames/s"

    deltas = {features.STATE: [k / RATE for k in centred()]}
    theirs = LeRobotDataset("local/benchmark", root=work / "ours", delta_timestamps=deltas)
    chosen = np.random.default_rng(0).integers(0, total, 10_000)
    cursor = iter(np.tile(chosen, 10))

    def one_of_theirs() -> int:
        theirs[int(next(cursor))]
        return 1

    yield "windows, lerobot", rate_of(one_of_theirs, 4.0), "windows/s"
    ours = WindowDataset(read_dataset(work / "ours"))
    yield (
        "windows, ours, one by one, all columns",
        rate_of(lambda: len([ours[int(i)] for i in chosen[:100]])),
        "windows/s",
    )

    reads = WindowDataset(ours.data, keys=[features.DEPTH])
    yield "windows, ours, batches of 256", rate_of(lambda: batches(reads, chosen)), "windows/s"

    if large:
        pack((episode(n, count, sensor) for n in range(large)), label, work / "large")
        many = large * count
        yield f"cold maps, {many} frames", many / seconds(lambda: read_dataset(work / "large")), "frames/s"
        far = WindowDataset(read_dataset(work / "large"), keys=[features.DEPTH])
        spread = np.random.default_rng(1).integers(0, many, 50_000)
        yield (f"windows, ours, batches of 256 of {many} frames", rate_of(lambda: batches(far, spread)), "windows/s")
        held = replace(far.data, columns={key: np.array(values) for key, values in far.data.columns.items()})
        memory = WindowDataset(held, keys=[features.DEPTH])
        yield (f"the same from arrays in memory, {many} frames", rate_of(lambda: batches(memory, spread)), "windows/s")


def batches(dataset, chosen: np.ndarray) -> int:
    """Read ``chosen`` in batches of 256 and return how many windows that was."""
    for start in range(0, len(chosen), 256):
        dataset.batch(chosen[start : start + 256])
    return len(chosen)


def main() -> None:
    """Measure, print a table and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--frames", type=int, default=300, help="frames an episode")
    parser.add_argument("--large", type=int, default=100, help="episodes of the larger dataset, 0 for none")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        os.environ |= {"HF_HUB_OFFLINE": "1", "HF_HOME": folder, "TACDATA_CACHE": str(work / "cache")}
        figures = {}
        for name, value, unit in measure(work, options.episodes, options.frames, options.large):
            figures[name] = value
            print(f"{name:<58} {value:>12,.0f} {unit}", flush=True)
    ratios = {
        "writing, ours over lerobot": figures["write, ours"] / figures["write, lerobot add_frame"],
        "windows, ours in batches over lerobot": figures["windows, ours, batches of 256"] / figures["windows, lerobot"],
    }
    for name, value in ratios.items():
        print(f"{name:<58} {value:>12,.1f} x")
    result = {
        "benchmark": "dataset_io",
        "episodes": options.episodes,
        "frames": options.frames,
        "large": options.large,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "code_version": provenance.code_version(),
        "figures": figures,
        "ratios": ratios,
    }
    if options.json:
        options.json.write_text(json.dumps(result, indent=1))
    print(json.dumps(result), file=sys.stdout)


if __name__ == "__main__":
    main()
