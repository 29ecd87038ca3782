"""The figures of one camera in one recording by which it is judged."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from tacdata.recording.check_clocks import clock_figures
from tacdata.recording.episode import TagStream
from tacdata.recording.reader import Recording


def camera_figures(recording: Recording, name: str) -> dict[str, Any]:
    """Return an entry of ``cameras`` in `schemas/check.schema.json`."""
    times, taxels = recording.cameras[name], recording.episode.taxels.arrival_ns
    tags = next((tag for tag in recording.episode.tags if tag.camera == name), None)
    rate = recording.episode.rig.get("cameras", {}).get(name, {}).get("rate")
    within = (int(taxels[0]), int(taxels[-1])) if len(taxels) else (0, 0)
    spans = np.diff(times.arrival_ns)
    return {
        "images": len(times.arrival_ns),
        "rate": _rounded(1e9 * len(spans) / spans.sum()) if len(spans) and spans.sum() > 0 else None,
        "nominal_rate": rate,
        "longest_gap": _longest_gap(times.arrival_ns, within),
        "longest_still": _longest_still(times.arrival_ns, times.digest),
        "searched": len(tags.faces) if tags else 0,
        "seen": _rounded(np.mean(tags.faces > 0)) if tags and len(tags.faces) else None,
        "reprojection": _reprojection(tags),
        "clock": clock_figures(recording.clocks.get(f"camera {name}"), 1e9 / rate if rate else 0.0, within),
    }


def _longest_gap(arrival_ns: np.ndarray, within: tuple[int, int]) -> float | None:
    """Return the longest time without an image [ms], from the recording's beginning to its end."""
    if not len(arrival_ns):
        return None
    moments = np.concatenate([[min(within[0], arrival_ns[0])], arrival_ns, [max(within[1], arrival_ns[-1])]])
    return _rounded(np.diff(moments).max() / 1e6)


def _longest_still(arrival_ns: np.ndarray, digest: np.ndarray) -> float:
    """Return the longest time over which the same image came again and again [ms]."""
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
