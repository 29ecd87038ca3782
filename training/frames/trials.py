"""The presses of a dataset as trials of the paper's evaluations: their roles, and one map for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import UsageError
from tacdata.recording.episode import PHASES
from tacdata.training.frames.frames import EpisodeSpan, Frames

DEPTH_TRIAL, POSITION_TRIAL, WEARING_TRIAL = "depth trial", "position trial", "wearing trial"
"""Purposes of presses in a plan; the shipped plan `evaluation` writes the first two."""


@dataclass(frozen=True)
class PressTrial:
    """One press at full depth."""

    span: EpisodeSpan
    """The episode."""
    tip: np.ndarray
    """Nominal x, y and depth of the indenter's lowest point at full depth [mm], shape (3,)."""
    label: np.ndarray
    """Labelled depth, mean over the frames at full depth [mm], shape (pixels_x, pixels_y)."""
    full: np.ndarray
    """Frames at full depth, numbers in the dataset, shape (m,), int64."""


def at_full_depth(frames: Frames, span: EpisodeSpan) -> np.ndarray:
    """Return which frames of an episode are valid and at full depth [bool], shape (n,).

    These are the frames of the hold; where a press has none, those within 0.01 mm of the deepest.
    """
    frame_slice = slice(span.start, span.stop)
    valid, tip = frames.valid[frame_slice], frames.tip[frame_slice, 2]
    full = valid & (frames.phase[frame_slice] == PHASES.index("hold"))
    return full if full.any() else valid & (tip >= tip.max() - 0.01)


def trials(frames: Frames, purpose: str) -> tuple[PressTrial, ...]:
    """Return the presses of a purpose as trials; every press if none in the dataset has a purpose.

    Presses into the air and presses without a valid frame at full depth are left out.
    """
    named = any(span.purpose for span in frames.episodes)
    spans = [span for span in frames.episodes if span.depth > 0 and (span.purpose == purpose or not named)]
    results = []
    for span in spans:
        full = span.start + np.flatnonzero(at_full_depth(frames, span))
        if len(full):
            label = np.clip(frames.depth[full], 0.0, frames.sensor.map.depth_max).mean(axis=0)
            results.append(PressTrial(span, frames.tip[full].mean(axis=0), label, full))
    return tuple(results)


def some(candidates: tuple[PressTrial, ...], purpose: str, origin: str) -> tuple[PressTrial, ...]:
    """Return trials, of which there must be one.

    Raises:
        UsageError: If there is none.
    """
    if not candidates:
        raise UsageError(
            f"{origin} holds no {purpose}",
            f"presses whose purpose in the plan is {purpose!r}",
            "record such a plan (`tacdata plan evaluation` writes depth and position trials)",
        )
    return candidates
