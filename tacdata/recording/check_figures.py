"""The figures of one recording by which it is judged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.recording.anchoring import RESOLUTION
from tacdata.recording.episode import PHASES, Episode
from tacdata.recording.reader import Recording

RUN = 12
"""Identical readings in a row that a live, noisy channel does not give [frames]."""
LIVE = 0.3
"""Noise from which the channels of a board count as live [counts]."""


@dataclass(frozen=True)
class Figures:
    """What was measured in one recording."""

    recording: Recording
    document: dict[str, Any]
    """An entry of ``episodes`` in `schemas/check.schema.json`."""
    lag: np.ndarray
    """Arrival minus sample time [ms], shape (n,)."""


def figures(recording: Recording) -> Figures:
    """Measure one recording."""
    episode = recording.episode
    lag = (episode.taxels.arrival_ns - episode.taxels.sample_ns) / 1e6
    tags = {tag.camera: tag for tag in episode.tags}
    cameras = {
        name: {
            "images": count,
            "searched": len(tags[name].faces) if name in tags else 0,
            "seen": _rounded(np.mean(tags[name].faces > 0))
            if name in tags and len(tags[name].faces)
            else None,
            "reprojection": _median(tags[name].reprojection) if name in tags else None,
        }
        for name, count in recording.images.items()
    }
    document = {
        "file": episode.path.name,
        "number": episode.number,
        "complete": episode.complete,
        "taxels": _taxels(recording, lag),
        "cnc": _cnc(recording),
        "cameras": cameras,
    }
    return Figures(recording, document, lag)


def _taxels(recording: Recording, lag: np.ndarray) -> dict[str, Any]:
    episode = recording.episode
    stream, sensor = episode.taxels, episode.sensor
    steps = (
        np.diff(stream.counter)
        if len(stream.counter) and stream.counter.min() >= 0
        else np.empty(0, np.int64)
    )
    noise, response = idle_noise(episode), hold_response(episode)
    stuck, saturated = frozen_channels(episode, noise)
    return {
        "frames": len(stream.counter),
        "rate": _rate(stream.sample_ns),
        "nominal_rate": float(recording.board.get("rate", {}).get("nominal", sensor.taxels.rate)),
        "lost": int(np.maximum(steps - 1, 0).sum()),
        "longest_gap": _longest(stream.sample_ns),
        "jitter": _rounded(lag.std()) if len(lag) else 0.0,
        "latency": _rounded(np.percentile(lag, 99) - lag.min()) if len(lag) else 0.0,
        "idle_noise": [None if np.isnan(value) else _rounded(value) for value in noise],
        "response": [None if np.isnan(value) else _rounded(value) for value in response],
        "stuck": stuck,
        "saturated": saturated,
        "driver_counts": recording.counts.get("taxels", {}),
    }


def _in_phase(episode: Episode, name: str) -> np.ndarray:
    return episode.taxels.counts[episode.phase_at(episode.taxels.sample_ns) == PHASES.index(name)]


def idle_noise(episode: Episode) -> np.ndarray:
    """Return each channel's noise without contact [counts], shape (taxels,); NaN with under 5 frames of rest.

    The standard deviation of neighbouring differences over sqrt(2): slow drift and recovery do not enter.
    """
    rest = _in_phase(episode, "rest")
    if len(rest) < 5:
        return np.full(episode.taxels.counts.shape[1], np.nan)
    return np.diff(rest, axis=0).std(axis=0) / np.sqrt(2)


def hold_response(episode: Episode) -> np.ndarray:
    """Return each channel's change from rest to hold [counts], shape (taxels,); NaN without either."""
    rest, hold = _in_phase(episode, "rest"), _in_phase(episode, "hold")
    if not len(rest) or not len(hold):
        return np.full(episode.taxels.counts.shape[1], np.nan)
    return np.median(hold, axis=0) - np.median(rest, axis=0)


def frozen_channels(episode: Episode, noise: np.ndarray) -> tuple[list[int], list[int]]:
    """Return the channels that stopped changing, and those that ran into a limit, among otherwise noisy ones.

    A run of identical readings that a live channel does not give is a limit if it is the channel's extreme
    and the channel moves elsewhere, and stuck otherwise. A board whose channels are all quiet (under `LIVE`
    counts of noise) proves nothing either way.
    """
    counts = episode.taxels.counts
    stuck, saturated = [], []
    constant = (counts == counts[:1]).all(axis=0) if len(counts) else np.ones(counts.shape[1], bool)
    moving = noise[~constant]
    live = bool(len(moving)) and not np.isnan(moving).all() and np.nanmedian(moving) > LIVE
    for channel in range(counts.shape[1]):
        values = counts[:, channel]
        if len(values) < RUN or (constant[channel] and (constant.all() or not live)):
            continue
        if constant[channel]:
            stuck.append(channel)
        elif live:
            length, value = _longest_run(values)
            if length >= RUN:
                (saturated if value in (values.max(), values.min()) else stuck).append(channel)
    return stuck, saturated


def _longest_run(values: np.ndarray) -> tuple[int, float]:
    edges = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1], [True]]))
    lengths = np.diff(edges)
    at = int(np.argmax(lengths))
    return int(lengths[at]), float(values[edges[at]])


def _cnc(recording: Recording) -> dict[str, Any]:
    stream, moves = recording.episode.cnc, recording.moves
    loaded = [move for move in moves if move.command.phase in ("press", "release")]
    slack = [(move.uncertainty_ns + move.contradiction_ns) * 1e-9 * move.profile.peak for move in loaded]
    return {
        "reports": len(stream.arrival_ns),
        "rate": _rate(stream.arrival_ns),
        "longest_gap": _longest(stream.arrival_ns),
        "start_uncertainty": _rounded(max((move.uncertainty_ns for move in moves), default=0) / 1e6),
        "depth_uncertainty": _rounded(max(slack, default=0.0) + RESOLUTION),
        "contradiction": _rounded(max((move.contradiction_ns for move in moves), default=0) / 1e6),
        "hold_error": _hold_error(recording),
        "states": sorted(set(stream.state)),
    }


def _hold_error(recording: Recording) -> float | None:
    hold = next((phase for phase in recording.episode.phases if phase.name == "hold"), None)
    press = next((move for move in recording.moves if move.command.phase == "press"), None)
    if hold is None or press is None:
        return None
    stream = recording.episode.cnc
    # The hold's end is an acknowledgement; its beginning is what the reports may put in doubt.
    # A report's own time is only known between query and answer.
    margin = int(np.max(stream.arrival_ns - stream.sample_ns, initial=0))
    begin = hold.end_ns - round(recording.episode.press.hold / 2 * 1e9)
    inside = (stream.sample_ns > begin) & (stream.sample_ns < hold.end_ns - margin)
    if not inside.any():
        return None
    return _rounded(np.linalg.norm(stream.position[inside] - press.command.target, axis=1).max())


def _rate(time_ns: np.ndarray) -> float | None:
    spans = np.diff(time_ns)
    return _rounded(1e9 / np.median(spans)) if len(spans) and np.median(spans) > 0 else None


def _longest(time_ns: np.ndarray) -> float:
    return _rounded(np.diff(time_ns).max() / 1e6) if len(time_ns) > 1 else 0.0


def _median(values: np.ndarray) -> float | None:
    return None if np.isnan(values).all() else _rounded(np.nanmedian(values))


def _rounded(value: Any) -> float:
    return round(float(value), 4)
