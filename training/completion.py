"""Completion of a trained network: corrected maxima, intervals, training readings.

Intervals and the scale of novelty need presses that a network did not learn from. These are the validation presses, or,
of a cross-fit, each press with a network that was fitted without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.training.frames.frames import Frames
from tacdata.training.frames.peak_regression import PeakRegression, fit_peaks
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics import conformal_intervals, novelty
from tacdata.training.metrics.pressed_area import pressed_area
from tacdata.training.networks.network import Network

MOST_FRAMES = 20_000
"""Frames that intervals are calibrated on, in whole presses evenly taken [count]."""


@dataclass(frozen=True)
class HeldOut:
    """Presses that a network did not learn from."""

    network: Network
    """The network."""
    learned: tuple[int, ...]
    """Numbers of the presses that it learned from."""
    presses: tuple[int, ...]
    """Numbers of the presses left out."""


def complete(
    best: Checkpoint,
    document: dict[str, Any],
    frames: Frames,
    learned: tuple[int, ...],
    parts: Sequence[HeldOut],
    parent: Checkpoint | None,
    source: str = conformal_intervals.VALIDATION,
) -> None:
    """Write a network with corrected maxima, and its intervals and training readings beside it.

    Args:
        best: The network and its file.
        document: Its document.
        frames: The dataset.
        learned: Numbers of the presses that it learned from.
        parts: Presses left out, with the networks that did not see them: itself, or those of a cross-fit.
        parent: The network that it was fitted from.
        source: Description of the presses left out.
    """
    prior = parent.peak if parent else None
    peak = fit_peaks(best.network, frames, learned, prior)
    corrected = {**document, **({"peak": peak.document} if peak else {})}
    # A resumed run that had ended is not written again: its hash is its identity.
    if not best.path.is_file() or corrected != checkpoint.load(best.path).document:
        checkpoint.save(best.path, best.network, None, corrected)
    run, identity = best.path.parent, checkpoint.load(best.path).content_hash
    maps, labels, rows = [], [], []
    for part in parts:
        # A part fitted to other presses needs a correction from these alone, or its errors would be too small.
        same_presses = part.learned == learned
        _set(part.network, peak if same_presses else fit_peaks(part.network, frames, part.learned, prior))
        windows = Windows(frames, part.network.offsets, part.network.get_buffer("mean").device)
        rows.append((frames.indices(part.learned), frames.indices(part.presses)))
        step = -(-len(rows[-1][1]) // MOST_FRAMES)
        for number in part.presses[::step]:
            part_frames = frames.indices((number,))
            maps.append(predict(part.network, windows, part_frames, frames.sensor.map.depth_max))
            labels.append(np.clip(frames.depth[part_frames], 0.0, frames.sensor.map.depth_max))
    if len(maps) > 1:
        pitch = frames.sensor.map.pixel_pitch
        sample = learned[:: -(-len(frames.indices(learned)) // MOST_FRAMES)]
        area = pressed_area([frames.depth[frames.indices((press,))] for press in sample], pitch)
        intervals = conformal_intervals.calibrate(maps, labels, pitch, identity, source, area)
        conformal_intervals.write(run, intervals)
    readings = novelty.gathered(frames, rows, identity, best.settings.mirror)
    if readings is not None:
        novelty.write(run, readings)


def _set(network: Network, peak: PeakRegression | None) -> None:
    if peak:
        network.set_peak(peak.mean, peak.scale, peak.weight)
