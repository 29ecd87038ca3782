"""Figures of one camera in one recording: rate, gaps, lost images, tags seen."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from tacdata.recording.check.clocks import clock_figures
from tacdata.recording.episode import TagStream
from tacdata.recording.files.reader import Recording


def camera_figures(recording: Recording, name: str) -> dict[str, Any]:
    """Return an entry of ``cameras`` in `schemas/check.schema.json`."""
    times, taxels = recording.cameras[name], recording.episode.taxels.arrival_ns
    tags = next((tag for tag in recording.episode.tags if tag.camera == name), None)
    rate = recording.episode.rig.get("cameras", {}).get(name, {}).get("rate")
    # A camera that begins late or ends early has a gap at the edge of the press.
    within = (int(taxels[0]), int(taxels[-1])) if len(taxels) else (0, 0)
    spans = np.diff(times.arrival_ns)
    counts = recording.counts.get(f"camera {name}", {})
    fingers = [stream for stream in recording.episode.fingers if stream.camera == name]
    return {
        "images": len(times.arrival_ns),
        "rate": _rounded(1e9 * len(spans) / spans.sum()) if len(spans) and spans.sum() > 0 else None,
        "nominal_rate": rate,
        "longest_gap": _longest_gap(times.arrival_ns, within),
        "longest_still": _longest_still(times.arrival_ns, times.digest),
        "lost": max(int(np.maximum(np.diff(times.sequence) - 1, 0).sum()), int(counts.get("lost", 0))),
        "damaged": int(counts.get("corrupt", 0)),
        "missed": missed(times.device_ns),
        "notes": list(counts.get("notes", [])),
        "searched": len(tags.faces) if tags else 0,
        "seen": _rounded(np.mean(tags.faces > 0)) if tags and len(tags.faces) else None,
        "reprojection": _reprojection(tags),
        "ambiguous": _ambiguous(tags),
        "fingers": {
            stream.finger: {
                "searched": len(stream.faces),
                "seen": _rounded(np.mean(stream.faces > 0)),
                "reprojection": _reprojection(stream),
                "ambiguous": _ambiguous(stream),
            }
            for stream in fingers
        },
        "clock": clock_figures(
            recording.clocks.get(f"camera {name}"), 1e9 / rate if rate else 0.0, times.arrival_ns, times.sample_ns
        ),
    }


def missed(device_ns: np.ndarray) -> int | None:
    """Return how many images are missing by the camera's own times [ns], shape (n,); None without them."""
    spans = np.diff(device_ns)
    if len(spans) < 2 or (device_ns < 0).any() or np.median(spans) <= 0:
        return None
    return int(np.maximum(np.rint(spans / np.median(spans)) - 1, 0).sum())


def _ambiguous(tags: TagStream | None) -> float | None:
    """Return the share of poses that a second pose explains as well."""
    if tags is None or tags.ambiguous is None or not (tags.faces > 0).any():
        return None
    return _rounded(np.mean(tags.ambiguous[tags.faces > 0]))


def _longest_gap(arrival_ns: np.ndarray, within: tuple[int, int]) -> float | None:
    """Return the longest time without an image [ms], from the recording's beginning to its end."""
    if not len(arrival_ns):
        return None
    # The board's readings mark the span: a camera that is silent at either end has a gap there.
    moments = np.concatenate([[min(within[0], arrival_ns[0])], arrival_ns, [max(within[1], arrival_ns[-1])]])
    return _rounded(np.diff(moments).max() / 1e6)


def _longest_still(arrival_ns: np.ndarray, digest: np.ndarray) -> float:
    """Return the longest time over which the same image was repeated [ms]."""
    if len(digest) < 2:
        return 0.0
    edges = np.flatnonzero(np.concatenate([[True], digest[1:] != digest[:-1], [True]]))
    return _rounded(max((arrival_ns[b - 1] - arrival_ns[a]) / 1e6 for a, b in pairwise(edges)))


def _reprojection(tags: TagStream | None) -> float | None:
    if tags is None or np.isnan(tags.reprojection).all():
        return None
    return _rounded(np.nanmedian(tags.reprojection))


def _rounded(value: Any) -> float:
    return round(float(value), 4)
