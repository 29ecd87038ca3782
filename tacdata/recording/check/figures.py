"""Figures of one recording: rates, losses, gaps, depth uncertainty, noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.recording.check.camera_figures import camera_figures
from tacdata.recording.check.channel_health import (
    frozen_channels,
    idle_noise,
    in_phase,
    jumps,
    reading_limits,
    tied_channels,
    undefined_channels,
)
from tacdata.recording.check.clocks import clock_figures, round_trip
from tacdata.recording.clocks.stream_pairs import StreamPair, stream_pairs
from tacdata.recording.episode import Episode
from tacdata.recording.files.reader import Recording

COUNTS = "counts"
"""Unit of readings where the board names none."""


@dataclass(frozen=True)
class RecordingFigures:
    """Measured figures of one recording."""

    recording: Recording
    document: dict[str, Any]
    """An entry of ``episodes`` in `schemas/check.schema.json`."""
    lag: np.ndarray
    """Arrival minus sample time [ms], shape (n,)."""


def figures(recording: Recording) -> RecordingFigures:
    """Compute the figures of one recording."""
    episode = recording.episode
    lag = (episode.taxels.arrival_ns - episode.taxels.sample_ns) / 1e6
    document = {
        "file": episode.path.name,
        "number": episode.number,
        "complete": episode.complete,
        "taxels": _taxels(recording, lag),
        "cnc": _cnc(recording),
        "sync": [
            {
                "first": pair.first,
                "second": pair.second,
                "offset": None if pair.offset is None else _rounded(pair.offset),
                "uncertainty": None if pair.uncertainty is None else _rounded(pair.uncertainty),
            }
            for pair in recording_pairs(recording)
        ],
        "cameras": {name: camera_figures(recording, name) for name in recording.images},
    }
    return RecordingFigures(recording, document, lag)


def recording_pairs(recording: Recording) -> tuple[StreamPair, ...]:
    """Return every pair of a recording's streams, and the known time between them."""
    streams = ["taxels", *(f"camera {name}" for name in recording.images)]
    clocks = {name: recording.clocks.get(name) for name in streams}
    return stream_pairs({name: clock.latency if clock else None for name, clock in clocks.items()})


def _taxels(recording: Recording, lag: np.ndarray) -> dict[str, Any]:
    episode = recording.episode
    stream, sensor = episode.taxels, episode.sensor
    steps = np.diff(stream.counter) if len(stream.counter) and stream.counter.min() >= 0 else np.empty(0, np.int64)
    noise, response = idle_noise(episode), hold_response(episode)
    stuck, saturated = frozen_channels(stream.counts, noise, reading_limits(recording.board))
    nominal = float(recording.board.get("rate", {}).get("nominal", sensor.taxels.rate))
    return {
        "frames": len(stream.counter),
        "rate": _rate(stream.sample_ns),
        "nominal_rate": nominal,
        "lost": int(np.maximum(steps - 1, 0).sum()),
        "longest_gap": _longest(stream.sample_ns),
        "unit": str(recording.board.get("unit", COUNTS)),
        "interval_spread": _spread(stream.sample_ns),
        "jitter": _rounded(lag.std()) if len(lag) else 0.0,
        "latency": _rounded(np.percentile(lag, 99) - lag.min()) if len(lag) else 0.0,
        "idle_noise": [None if np.isnan(value) else _rounded(value) for value in noise],
        "response": [None if np.isnan(value) else _rounded(value) for value in response],
        "idle_reading": [None if np.isnan(value) else _rounded(value) for value in idle_reading(episode)],
        "stuck": stuck,
        "saturated": saturated,
        "undefined": undefined_channels(stream.counts),
        "tied": tied_channels(stream.counts),
        "jumps": [
            {"channel": j.channel, "size": _rounded(j.size), "at": _rounded((j.time_ns - stream.sample_ns[0]) / 1e9)}
            for j in jumps(episode, noise, response)
        ],
        "clock": clock_figures(recording.clocks.get("taxels"), 1e9 / nominal, stream.arrival_ns, stream.sample_ns),
        "driver_counts": recording.counts.get("taxels", {}),
    }


def idle_reading(episode: Episode) -> np.ndarray:
    """Return each channel's reading without contact [counts], shape (taxels,); NaN without a rest."""
    frames = in_phase(episode, "rest")
    return np.median(frames, axis=0) if len(frames) else np.full(episode.taxels.counts.shape[1], np.nan)


def hold_response(episode: Episode) -> np.ndarray:
    """Return each channel's change from rest to hold [counts], shape (taxels,); NaN without either."""
    idle, hold = in_phase(episode, "rest"), in_phase(episode, "hold")
    if not len(idle) or not len(hold):
        return np.full(episode.taxels.counts.shape[1], np.nan)
    return np.median(hold, axis=0) - np.median(idle, axis=0)


def _cnc(recording: Recording) -> dict[str, Any]:
    stream = recording.episode.cnc
    # A move that was interrupted did not run to its end, so its profile cannot be compared.
    moves = recording.moves if recording.episode.complete else recording.moves[:-1]
    # Depth matters while the skin is loaded. Elsewhere an uncertain start of a move costs nothing.
    loaded = [move for move in moves if move.command.phase in ("press", "release")]
    slack = [(move.uncertainty_ns + move.contradiction_ns) * 1e-9 * move.profile.peak for move in loaded]
    return {
        "reports": len(stream.arrival_ns),
        "rate": _rate(stream.arrival_ns),
        "longest_gap": _longest(stream.arrival_ns),
        "round_trip": round_trip(recording),
        "start_uncertainty": _rounded(max((move.uncertainty_ns for move in moves), default=0) / 1e6),
        "depth_uncertainty": _rounded(max(slack, default=0.0) + recording.height_resolution),
        "contradiction": _rounded(max((move.contradiction_ns for move in moves), default=0) / 1e6),
        "hold_error": _hold_error(recording),
        "states": sorted(set(stream.state)),
        "damaged": recording.counts.get("cnc", {}).get("corrupt", 0),
    }


def _hold_error(recording: Recording) -> float | None:
    hold = next((phase for phase in recording.episode.phases if phase.name == "hold"), None)
    press = next((move for move in reversed(recording.moves) if move.command.phase == "press"), None)
    if hold is None or press is None:
        return None
    stream = recording.episode.cnc
    # The hold's end is an acknowledgement; only its beginning depends on the reports.
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


def _spread(time_ns: np.ndarray) -> float:
    """Return the jitter of sample times: half of the span of the middle 68 % of the intervals [ms]."""
    return _rounded(np.ptp(np.percentile(np.diff(time_ns), [16, 84])) / 2e6) if len(time_ns) > 2 else 0.0


def _longest(time_ns: np.ndarray) -> float:
    return _rounded(np.diff(time_ns).max() / 1e6) if len(time_ns) > 1 else 0.0


def _rounded(value: Any) -> float:
    """Return a figure to four places, or to five digits where it is small: capacitances in farad are 1e-12."""
    value = float(value)
    return round(value, 4) if abs(value) >= 1 or not np.isfinite(value) else float(f"{value:.5g}")
