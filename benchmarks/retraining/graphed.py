"""Trains a network on a card with each step as one CUDA graph: many more steps a second than `tacdata train`.

A step of a network this small launches a hundred kernels of a few microseconds, and Python takes longer than they do.
Recipe, variation, loss and checkpoint are those of `training.train`; frames are drawn with replacement, and the last
weights are kept, not the best.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from tacdata.training import train as loop
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.variation import Variation
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import BEST, Checkpoint, load, save
from tacdata.training.loss import normalized
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import Split

_TRIAL, _WARM_UP = 200, 0.02
"""Steps that tell how long one takes [count]; share of the steps over which the rate rises [1]."""
_LEAST = 0.01
"""Lowest rate over the highest [1]."""
_CALIBRATED = 300
"""Presses that calibrate the channels [count]: simulated gains are known to begin with."""


def train_graphed(
    frames: Frames,
    settings: TrainingSettings,
    split: Split,
    run: Path,
    steps: int,
    until: float,
    lines: int = 20,
    shown: Callable[[str], None] = print,
) -> Checkpoint:
    """Train for so many steps, or until a time, and write RUN/best.safetensors.

    Args:
        frames: Simulated presses.
        settings: The recipe; its epochs count for nothing.
        split: Which presses are learned from, and which tell the loss.
        run: Folder to write.
        steps: Steps, over which the rate falls.
        until: When training must be done [s since 1970]; the rate falls sooner if need be.
        lines: How often the loss on the validation presses is reported.
        shown: Called with each line of progress.
    """
    place = torch.device("cuda")
    torch.set_float32_matmul_precision("high")
    some = Split(split.name, split.seed, split.train[:_CALIBRATED], split.validation, split.test)
    state = loop._started(frames, settings, some, place, None)
    state.document["split"] = split.document
    network = state.network.train()
    learned, validated = frames.indices(split.train), frames.indices(split.validation)
    deepest = frames.depth[learned].max(axis=(1, 2))
    touching, idle = learned[deepest > CONTACT_THRESHOLD], learned[deepest <= CONTACT_THRESHOLD]
    windows, varied = Windows(frames, network.offsets, place), Variation(network, frames.sensor, settings)
    order = np.concatenate([touching, idle])
    label = normalized(torch.from_numpy(frames.depth[order]).to(place), frames.sensor.map.depth_max)
    index = windows.index(torch.from_numpy(order).to(place))
    # Of frames out of contact fewer are drawn, without touching the list: two draws, and one number between them.
    share = len(touching) / (len(touching) + settings.idle_share * len(idle))
    rate = torch.zeros((), device=place)
    optimizer = torch.optim.AdamW(
        network.parameters(), rate, weight_decay=settings.weight_decay, fused=True, capturable=True
    )
    total = torch.zeros((), device=place)

    def step() -> None:
        draw = torch.rand(2, settings.batch_size, device=place)
        first = (draw[1] * len(touching)).long().clamp(max=len(touching) - 1)
        other = len(touching) + (draw[1] * len(idle)).long().clamp(max=len(idle) - 1)
        chosen = torch.where(draw[0] < share, first, other)
        signals, wanted = varied(network.calibrated(windows.taxels[index[chosen]]), label[chosen])
        loss = settings.loss(network.respond(signals), wanted)
        optimizer.zero_grad(set_to_none=False)
        loss.backward()
        optimizer.step()
        total.add_(loss.detach())

    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(5):
            step()
    torch.cuda.current_stream().wait_stream(stream)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        step()
    torch.cuda.synchronize()
    began = time.monotonic()
    for _ in range(_TRIAL):
        graph.replay()
    torch.cuda.synchronize()
    seconds = (time.monotonic() - began) / _TRIAL
    began, now, done, line = time.time(), time.time(), 0, 0
    shown(f"{1000 * seconds:.2f} ms a step, {len(touching)} frames in contact, {len(idle)} out of it")
    while done < steps and now < until:
        part = max(done / steps, (now - began) / (until - began))
        rise = min(1.0, part / _WARM_UP)
        rate.fill_(settings.learning_rate * rise * (_LEAST + (1 - _LEAST) * 0.5 * (1 + math.cos(math.pi * part))))
        for _ in range(50):
            graph.replay()
        torch.cuda.synchronize()
        done, now = done + 50, time.time()
        if part >= (line + 1) / lines:
            line += 1
            told = loop._validate(network, windows, frames, validated, settings)
            network.train()
            shown(f"step {done}: validation loss {told['validation_loss']:.6f}")
    state.epoch = 1
    line_of_document = {
        "epoch": 1,
        "train_loss": float(total) / (done + _TRIAL + 6),
        **loop._validate(network, windows, frames, validated, settings),
        "seconds": round(time.time() - began, 3),
    }
    state.document["provenance"]["parameters"] |= {"steps": done}
    loop._keep(state, line_of_document, run)
    return load(run / BEST)


def halved(trained: Checkpoint, path: Path) -> None:
    """Write a checkpoint with weights of half precision: a file of half the size, maps that differ by 0.4 um."""
    network = copy.deepcopy(trained.network)
    for weight in network.parameters():
        weight.data = weight.data.half()
    save(path, network, None, trained.document)
