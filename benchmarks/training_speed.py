"""How fast windows reach the trainer, a training step runs, and one frame is inferred.

    python benchmarks/training_speed.py [--dataset FOLDER] [--network paper] [--device cpu]
                                        [--threads 1] [--precision bfloat16] [--compile] [--batch 32] [--json FILE]

With a dataset, training from its memory maps is compared with training from copies in memory. Without one the frames
are random numbers of the paper's sensor. Windows are gathered in random order with their label maps, as in training;
steps are those of `tacdata train`, timed from the tenth on; inference takes one frame at a time on one CPU thread.
Each figure is the best of three runs. Nothing else should run on the machine.
"""

from __future__ import annotations

import argparse
import json
import platform
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from tacdata import provenance
from tacdata.sensor import default_sensor
from tacdata.training.frames.data import read_frames
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import load
from tacdata.training.inference.compute import choose_device, reproducible
from tacdata.training.inference.predictor import milliseconds_per_frame
from tacdata.training.settings import TrainingSettings
from tacdata.training.train import Progress, train

REPEATS = 3


def random_frames(episodes: int = 40, length: int = 150) -> Frames:
    """Return frames of random numbers; speed does not depend on their values."""
    sensor, generator, n = default_sensor(), np.random.default_rng(0), episodes * length
    spans = [EpisodeSpan(k, k * length, (k + 1) * length, "", "", 0.0, 0.0, 1.0) for k in range(episodes)]
    return Frames(
        taxels=generator.normal(0, 100, (n, sensor.taxels.count)).astype(np.float32),
        depth=generator.random((n, *sensor.map.shape), dtype=np.float32),
        tip=np.zeros((n, 3), np.float32),
        phase=np.zeros(n, np.int64),
        time_ns=np.arange(n),
        valid=np.ones(n, bool),
        episodes=tuple(spans),
        sensor=sensor,
        dataset_hash="0" * 64,
        origin="random numbers",
    )


def windows_per_second(frames: Frames, device: torch.device, batch: int) -> float:
    """Return windows with label maps gathered per second."""
    windows = Windows(frames, tuple(range(-4, 5)), device)
    depth = torch.from_numpy(np.array(frames.depth)).to(device)
    order = torch.randperm(len(windows)).to(device)

    def once() -> float:
        began = time.perf_counter()
        for chosen in order.split(batch):
            _ = windows.batch(chosen), depth[chosen]
        if device.type == "cuda":
            torch.cuda.synchronize()
        return time.perf_counter() - began

    return len(order) / best(once)


def in_memory(frames: Frames) -> Frames:
    """Return the same frames with every column copied into memory."""
    columns = ("taxels", "depth", "tip", "phase", "time_ns", "valid")
    return replace(frames, **{name: np.array(getattr(frames, name)) for name in columns})


def steps_per_second(frames: Frames, given: argparse.Namespace, device: str, folder: Path) -> float:
    """Return training steps per second, the first ten not counted; leaves the last run in ``folder``."""
    number = 0

    def once() -> float:
        nonlocal number
        number += 1
        times: list[float] = []

        def note(progress: Progress) -> None:
            if progress.finished is None:
                if device != "cpu":
                    torch.cuda.synchronize()
                times.append(time.perf_counter())

        recipe = TrainingSettings(network=given.network, epochs=1, batch_size=given.batch, precision=given.precision)
        train(frames, recipe, folder / str(number), device, False, given.threads, note, given.compile)
        return (times[-1] - times[9]) / (len(times) - 10)

    return 1.0 / best(once)


def best(measure: Callable[[], float]) -> float:
    """Return the shortest of `REPEATS` times [s]."""
    return min(measure() for _ in range(REPEATS))


def main() -> None:
    """Measure, print one JSON line a figure, and write them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", type=Path)
    parser.add_argument("--network", default="paper")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--precision", default="float32")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    device = choose_device(given.device)
    frames = read_frames(given.dataset) if given.dataset else random_frames()
    figures: dict[str, object] = {
        "machine": platform.processor() or platform.machine(),
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else "cpu",
        "torch": torch.__version__,
        "code_version": provenance.code_version(),
        "frames": len(frames.taxels),
        "network": given.network,
        "precision": given.precision,
        "compiled": given.compile,
    }
    with tempfile.TemporaryDirectory() as folder, reproducible(given.threads):
        figures["threads"] = torch.get_num_threads()
        for batch in (32, 1024):
            figures[f"windows_per_s_batch_{batch}"] = round(windows_per_second(frames, device, batch))
        speed = steps_per_second(frames, given, device.type, Path(folder))
        figures[f"train_steps_per_s_batch_{given.batch}"] = round(speed, 2)
        if given.dataset:
            held = steps_per_second(in_memory(frames), given, device.type, Path(folder) / "memory")
            figures["train_steps_per_s_from_memory"] = round(held, 2)
            figures["maps_over_memory"] = round(speed / held, 3)
        network = load(Path(folder) / "1").network
        windows = Windows(frames, network.offsets)
        pace = best(lambda: milliseconds_per_frame(network, windows))
        figures["inference_ms_per_frame_one_core"] = round(pace, 3)
    for name, value in figures.items():
        print(json.dumps({name: value}))
    if given.json:
        given.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
