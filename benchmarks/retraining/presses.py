"""Solved presses as frames in memory, made by all cores: the output of `tacdata simulate --out`, without the files.

Ten thousand episodes take a quarter of an hour to write as a dataset, one after the other. A card is lent for less.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.dataset import frames as columns
from tacdata.dataset.format import features
from tacdata.label_farm.simulated.packing import simulated_episode
from tacdata.label_farm.simulated.shard import read_about, read_shard, shard_files
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.swallowed_shape import swallowed_at
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD

CHUNK = 64
"""Presses in a file of packed frames [count]."""
MOVED = 0.04
"""Way of the tip between two frames in contact that are both learned from [mm]."""
_HELD, _IDLE = 8, 3
"""Of equal frames, one in so many is learned from: while the tip holds, and out of contact [count]."""
_HELD_MOST = 3
"""Frames of a hold that are learned from [count]."""
_KEYS = {
    "taxels": features.STATE,
    "depth": features.DEPTH,
    "tip": features.TIP,
    "phase": features.PHASE,
    "time_ns": features.TIME,
    "valid": features.VALID,
    "taxel_force": features.TAXEL_FORCE,
}


@dataclass(frozen=True)
class _Task:
    """Presses of one file of solutions that become one file of frames."""

    solved: Path
    shard: Path
    numbers: tuple[int, ...]
    target: Path


def pack(solved: Path, out: Path, workers: int) -> int:
    """Turn solved presses into files of frames, those that are missing; return how many presses are in files.

    Args:
        solved: Folder of `tacdata simulate --solved`.
        out: Folder of the files.
        workers: Processes.
    """
    out.mkdir(parents=True, exist_ok=True)
    tasks = []
    for shard in shard_files(solved):
        numbers = read_about(shard).numbers
        for start in range(0, len(numbers), CHUNK):
            target = out / f"{shard.stem}-{start:05d}.npz"
            if not target.exists():
                tasks.append(_Task(solved, shard, tuple(numbers[start : start + CHUNK]), target))
    if tasks:
        with ProcessPoolExecutor(min(workers, len(tasks))) as pool:
            for k, _ in enumerate(pool.map(_pack, tasks), start=1):
                if k % 16 == 0 or k == len(tasks):
                    print(f"packed {k} of {len(tasks)} files of up to {CHUNK} presses", file=sys.stderr, flush=True)
    return sum(len(np.load(path)["number"]) for path in out.glob("*.npz"))


def read(solved: Path, packed: Path, files: int | None = None) -> Frames:
    """Return packed presses as one set of frames.

    Args:
        solved: Folder of the solved presses, which names the settings that they are drawn from.
        packed: Folder that `pack` wrote.
        files: How many of its files; all if left out.
    """
    simulation = Simulation.read(solved)
    parts = [np.load(path) for path in sorted(packed.glob("*.npz"))[:files]]
    lengths = np.concatenate([part["length"] for part in parts])
    numbers = np.concatenate([part["number"] for part in parts]).tolist()
    arrays = {name: np.concatenate([part[name] for part in parts]) for name in _KEYS}
    ends = np.cumsum(lengths).tolist()
    spans = []
    for number, length, end in zip(numbers, lengths.tolist(), ends, strict=True):
        press = simulation.press(number)
        spans.append(
            EpisodeSpan(
                number,
                end - length,
                end,
                press.indenter_name,
                press.indenter.shape,
                press.x,
                press.y,
                press.depth,
                press.speed,
                simulation.specimen(number).name,
            )
        )
    identity = provenance.content_hash({"simulation": simulation.content_hash, "presses": numbers})
    origin = f"{len(numbers)} presses of plan {simulation.plan.name}, seed {simulation.seed}"
    return Frames(
        **arrays,
        episodes=tuple(spans),
        sensor=simulation.sensor,
        dataset_hash=identity,
        origin=origin,
        virtual=False,
        simulated=True,
    )


def thinned(frames: Frames) -> Frames:
    """Return frames of which only such are learned from as differ from each other; the others stay in windows.

    A hold gives dozens of frames that differ in noise alone.
    """
    kept = np.zeros(len(frames.taxels), bool)
    for span in frames.episodes:
        depth = frames.tip[span.start : span.stop, 2]
        touching = frames.depth[span.start : span.stop].max(axis=(1, 2)) > CONTACT_THRESHOLD
        kept[span.start : span.stop] = _different(depth, touching)
    return replace(frames, valid=frames.valid & kept)


def _different(depth: np.ndarray, touching: np.ndarray) -> np.ndarray:
    kept, last, still = np.zeros(len(depth), bool), -np.inf, 0
    for k, (now, contact) in enumerate(zip(depth.tolist(), touching.tolist(), strict=True)):
        if not contact:
            kept[k] = k % _IDLE == 0
        elif abs(now - last) >= MOVED:
            kept[k], last, still = True, now, 0
        else:
            still += 1
            kept[k] = still % _HELD == 0 and still <= _HELD * _HELD_MOST
    return kept


def _pack(task: _Task) -> None:
    simulation, solutions = Simulation.read(task.solved), read_shard(task.shard).solutions
    numbers: list[int] = []
    found: dict[str, list[np.ndarray]] = {name: [] for name in _KEYS}
    for number in task.numbers:
        solution = solutions.get(number)
        if solution is None:
            continue
        job = simulation.job(simulation.press(number), solution.provenance["parents"]["model"])
        if swallowed_at(job, simulation.specimen(number), solution) is not None:
            continue
        table = columns.episode_columns(*simulated_episode(simulation, number, solution))
        numbers.append(number)
        for name, key in _KEYS.items():
            found[name].append(table[key])
    if not numbers:
        return
    _write(task.target, numbers, found)


def _write(target: Path, numbers: Sequence[int], found: dict[str, list[np.ndarray]]) -> None:
    arrays = {name: np.concatenate(values) for name, values in found.items()}
    arrays |= {"number": np.array(numbers), "length": np.array([len(part) for part in found["taxels"]])}
    temporary = target.with_suffix(".part")
    with temporary.open("wb") as stream:
        np.savez(stream, **arrays)
    os.replace(temporary, target)
