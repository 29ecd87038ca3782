"""Completion of a trained network: corrected maxima, intervals, training readings.

Intervals and the scale of novelty need presses that a network did not learn from. These are the validation presses, or,
of a cross-fit, each press with a network that was fitted without it.

Validation presses are few. The network before a fit has learned from no press, and its Gaussian process leaves each out
in closed form. So with fewer than `FEW` validation presses it gives the intervals where there is one. Validation
presses scale them to the fitted network.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from tacdata.training.frames.frames import Frames
from tacdata.training.frames.peak_process import LEAST, PeakProcess, contacts, fit_process
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics import conformal_intervals, novelty
from tacdata.training.networks.network import Network

MOST_FRAMES = 20_000
"""Frames that intervals are calibrated on, in whole presses evenly taken [count]."""
SHARES = (0.75, 1.0, 0.5, 0.25, 0.0)
"""Shares of the Gaussian process in a maximum that are tried [1].

With few presses it is the first, unless they surely favour another one. It was chosen on rigs 30 and 31. By the least
error of four presses rig 61 had a share of 0: 0.066 for 0.056 mm."""
MEAN = 0.5
"""The share after a cross-fit [1]: few presses choose no better (rigs 30 and 31: 0.060 mm, chosen by presses 0.068)."""
FEW = 10
"""Presses left out below which these choose little by themselves [count].

The four of 30 presses gain by it (rigs 30, 31, 60, 61, 70, 71), the 14 of 96 do not (rigs 30, 60, 61)."""
EACH = "presses left out one by one"
"""Calibration data of intervals by the network before the fit."""


@dataclass(frozen=True)
class HeldOut:
    """Presses that a network did not learn from."""

    network: Network
    """The network."""
    learned: tuple[int, ...]
    """Numbers of the presses that it learned from."""
    presses: tuple[int, ...]
    """Numbers of the presses left out."""
    together: bool = False
    """Whether a process leaves all of them out at once, as of one shape, or one after the other."""


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
    presses = tuple(sorted({*learned, *(press for part in parts for press in part.presses)}))
    origin = None
    if parent:
        origin = copy.deepcopy(parent.network).to(best.network.get_buffer("mean").device).requires_grad_(False).eval()
    process = fit_process(contacts(best.network, frames, presses, origin))
    results = [_predicted(part, frames, presses, origin, process) for part in parts]
    if process:
        several = len(parts) > 1
        process = replace(process, share=MEAN if several else _share([press for part in results for press in part]))
    # With too few presses for a process, the correction that the network had before the fit stays.
    best.network.peak = process or (origin.peak if origin is not None else None)
    corrected = {**document, **({"peak": peak.document} if isinstance(peak := best.network.peak, PeakProcess) else {})}
    # A resumed run that had ended is not written again: its hash is its identity.
    if not best.path.is_file() or corrected != checkpoint.load(best.path).document:
        checkpoint.save(best.path, best.network, None, corrected)
    run, identity = best.path.parent, checkpoint.load(best.path).content_hash
    left_out = [press.corrected(process) for part in results for press in part]
    if len(left_out) > 1:
        (maps, labels, spreads), pitch = _columns(left_out), frames.sensor.map.pixel_pitch
        if process and origin and len(parts) == 1 and len(left_out) < FEW:
            before = copy.deepcopy(best.network)
            before.load_state_dict(origin.state_dict())
            whole = replace(process, share=1.0)
            validation, training = (
                [p.corrected(whole) for p in _predicted(HeldOut(before, (), numbers), frames, presses, origin, process)]
                for numbers in (parts[0].presses, learned)
            )
            others, every_label, every_spread = _columns(validation + training)
            intervals = conformal_intervals.calibrate(others, every_label, pitch, identity, EACH, every_spread)
            intervals = intervals.adapted(maps, others[: len(maps)], labels, spreads, pitch)
        else:
            intervals = conformal_intervals.calibrate(
                maps, labels, pitch, identity, source, spreads if process else None
            )
        conformal_intervals.write(run, intervals)
    rows = [(frames.indices(part.learned), frames.indices(part.presses)) for part in parts]
    readings = novelty.gathered(frames, rows, identity, best.settings.mirror)
    if readings is not None:
        novelty.write(run, readings)


@dataclass(frozen=True)
class _Press:
    """A press left out: maps with the correction before the fit, and the answers of a process without it."""

    maps: np.ndarray
    """Maps [mm], shape (m, pixels_x, pixels_y)."""
    label: np.ndarray
    """Labels [mm], same shape."""
    maximum: np.ndarray
    """Maxima of the process [mm], shape (m,)."""
    deviation: np.ndarray
    """Deviations of the process [1], shape (m,)."""
    top: float
    """D_max [mm]."""

    def corrected(self, process: PeakProcess | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return corrected maps [mm], labels [mm] and the process's deviations [1]."""
        maps = self.maps
        if process:
            depth, maximum = torch.from_numpy(maps / self.top), torch.from_numpy(self.maximum / self.top).float()
            maps = (process.rescaled(depth, maximum).clamp(0.0, 1.0) * self.top).numpy()
        return maps, self.label, self.deviation


def _predicted(
    part: HeldOut, frames: Frames, presses: tuple[int, ...], origin: Network | None, process: PeakProcess | None
) -> list[_Press]:
    """Return the presses left out, by a network without them, and by processes without each."""
    part.network.peak = origin.peak if origin is not None else None
    known = contacts(part.network, frames, presses, origin)
    windows = Windows(frames, part.network.offsets, part.network.get_buffer("mean").device)
    top, results = frames.sensor.map.depth_max, []
    step = -(-len(frames.indices(part.presses)) // MOST_FRAMES)
    for number in part.presses[::step]:
        chosen = frames.indices((number,))
        maps, label = predict(part.network, windows, chosen, top), np.clip(frames.depth[chosen], 0.0, top)
        maximum, deviation = maps.max(axis=(1, 2)), np.ones(len(chosen))
        # A process of these presses too would err too little on them.
        others = known.without(part.presses if part.together else (number,))
        if own := process and fit_process(others, process.kernel):
            answer, deviation = own.answers(part.network, windows, chosen)
            maximum = answer * top
        results.append(_Press(maps, label, maximum, deviation, top))
    return results


def _columns(presses: Sequence[tuple[np.ndarray, ...]]) -> list[list[np.ndarray]]:
    """Return maps, labels and deviations of presses, each as a list."""
    return [list(column) for column in zip(*presses, strict=True)]


def _share(presses: Sequence[_Press]) -> float:
    """Return the share of the process in a maximum, by its mean error over presses left out."""
    losses = []
    for press in presses:
        label, largest = press.label.max(axis=(1, 2)), np.maximum(press.maps.max(axis=(1, 2)), LEAST)
        touching = label > LEAST
        if touching.any():
            ratio = np.maximum(press.maximum, LEAST) / largest
            losses.append([np.abs(largest * ratio**share - label)[touching].mean() for share in SHARES])
    if not losses:
        return SHARES[0]
    return SHARES[chosen(np.array(losses)) if len(losses) < FEW else int(np.mean(losses, axis=0).argmin())]


def chosen(losses: np.ndarray) -> int:
    """Return the first column whose mean is at most a standard error above the least one.

    Args:
        losses: Loss on each press by each share, shape (presses, shares), the most cautious share first.
    """
    excess = losses - losses[:, [losses.mean(axis=0).argmin()]]
    error = excess.std(axis=0, ddof=1) / np.sqrt(len(excess)) if len(excess) > 1 else 0.0
    return int(np.argmax(excess.mean(axis=0) <= error))
