"""Whether the streams of a recording tell the same time: gone astray, gone back, or one camera later than another.

Two cameras that see the same fingers tell their times apart by the motion. The lag is the one at which both paths
differ least. Latency only makes images late, so the later camera is the wrong one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from tacdata.demonstrations.paths.motion_filter import Smoothed, logarithm
from tacdata.demonstrations.paths.sightings import Sightings
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import FormatError

ASTRAY = 2.0
"""Distance of a stream from all others at which they are not of one recording [s]."""
BACK = 0.1
"""Step back of a stream's times that is more than jitter [s]."""
LAGS = np.arange(-6.0, 6.0001, 0.02)
"""Lags that are tried [s], shape (m,)."""
FINE = np.arange(-0.02, 0.0201, 0.002)
"""Lags about the best of them [s], shape (m,)."""
SHORTEST = 0.012
"""Smallest lag that is said [s]; the stated latencies are known to some milliseconds."""
BETTER = 2.0
"""Ratio of the mean squared differences without and with the lag from which it counts [1]."""
SPACED = 0.2
"""Largest interval between sightings over which a path is interpolated [s]."""
FEWEST = 40
"""Sightings of one camera that must fall on the other's path [count]."""
OVERLAP = 0.4
"""The same, as a share of all of its sightings [1]."""
KEPT = 0.9
"""Share of the differences that count; the largest are outliers [1]."""
LATE = 0.05
"""Standard uncertainty of image times from which it is said [s]."""
RESIDUAL = 0.01
"""Standard uncertainty of image times that were moved by a lag [s]."""


def check_together(recording: DemoRecording) -> None:
    """Refuse streams that do not share a time.

    Raises:
        FormatError: If a stream's times go back, or lie apart from all others.
    """
    times = {f"the board of {name}": stream.sample_ns for name, stream in recording.taxels.items()}
    times |= {f"camera {view.camera} on {view.finger}": view.sample_ns for view in recording.views}
    times = {name: values for name, values in times.items() if len(values)}
    for name, values in times.items():
        step = np.diff(values) * 1e-9
        if len(step) and step.min() < -BACK:
            when = (values[int(step.argmin())] - values[0]) * 1e-9
            raise FormatError(
                f"{recording.path}: the times of {name} go back by {-step.min():.1f} s, {when:.1f} s after its first",
                "times that go forward",
                "a clock was set meanwhile: record again, without changing the host's clock",
            )
    spans: dict[str, tuple[int, int]] = {}
    for name, values in times.items():
        device = name.split(" on ")[0]
        first, last = spans.get(device, (int(values[0]), int(values[-1])))
        spans[device] = min(first, int(values[0])), max(last, int(values[-1]))
    for device, (first, last) in spans.items():
        others = [span for other, span in spans.items() if other != device]
        if not others:
            continue
        begin, end = min(span[0] for span in others), max(span[1] for span in others)
        apart = max(first - end, begin - last) * 1e-9
        if apart > ASTRAY:
            side = "after" if first > end else "before"
            raise FormatError(
                f"{recording.path}: {device} lies {apart:.0f} s {side} all other streams",
                "streams of one time",
                "its clock or its latency is wrong: correct the rig file, and record again",
            )


def in_step(
    recording: DemoRecording, seen: Mapping[str, Sightings]
) -> tuple[DemoRecording, dict[str, float], list[str]]:
    """Move images of a camera that is later than another; return the recording, camera -> by how much [s], and words.

    Args:
        recording: The recording.
        seen: Finger -> its sightings.
    """
    cameras = sorted({camera for found in seen.values() for camera in found.camera})
    moved: dict[str, float] = {}
    words = []
    for one, other in combinations(cameras, 2):
        lag = _lag(seen, one, other)
        if lag is None or one in moved or other in moved:
            continue
        late, early = (other, one) if lag > 0 else (one, other)
        moved[late] = abs(lag)
        words.append(
            f"the images of camera {late} are {abs(lag):.2f} s later than those of camera {early}, by the motion that "
            "both saw: they are moved back by that; correct the camera's latency in the demo rig"
        )
    views = tuple(
        replace(view, sample_ns=view.sample_ns - round(moved.get(view.camera, 0.0) * 1e9)) for view in recording.views
    )
    timing = recording.timing | {name: max(RESIDUAL, recording.timing.get(name, 0.0)) for name in moved}
    return replace(recording, views=views, timing=timing) if moved else recording, moved, words


def carried_through(path: Smoothed, times_ns: np.ndarray, timing: float) -> Smoothed:
    """Return a path whose covariance holds the error of the images' times.

    Neighbouring images are late alike. So this error does not average out, as the noise of single images does.

    Args:
        path: A smoothed path.
        times_ns: Its times [ns], shape (n,), ascending.
        timing: Standard uncertainty of the times [s].
    """
    covariance, seconds = path.covariance.copy(), times_ns * 1e-9 - times_ns[0] * 1e-9
    last = len(times_ns) - 1
    for k in np.flatnonzero(np.isfinite(path.position).all(axis=1)):
        a, b = max(k - 1, 0), min(k + 1, last)
        turn = path.rotation[b] @ path.rotation[a].T
        turning = logarithm(turn) / (seconds[b] - seconds[a]) if np.isfinite(turn).all() and b > a else np.zeros(3)
        rate = np.concatenate([turning, path.velocity[k]])
        covariance[k] += timing**2 * np.outer(rate, rate)
    return replace(path, covariance=covariance)


def late_words(timing: Mapping[str, float], paths: Mapping[str, Smoothed]) -> list[str]:
    """Say which cameras' image times are known badly, and what that means for moving fingers."""
    fastest = max(float(np.nanmax(np.linalg.norm(path.velocity, axis=1), initial=0.0)) for path in paths.values())
    return [
        f"the times of camera {name}'s images are known to {sigma:.2f} s only: a finger that moves is known to up to "
        f"{1000 * sigma * fastest:.0f} mm; a host that keeps up, or a camera with times of its own, knows them better"
        for name, sigma in timing.items()
        if sigma > LATE
    ]


def _lag(seen: Mapping[str, Sightings], one: str, other: str) -> float | None:
    """Return how much later the images of another camera are than those of one [s]; None if they are not."""
    pairs = []
    for found in seen.values():
        of = [np.array([camera == name for camera in found.camera]) for name in (one, other)]
        if all(rows.sum() >= FEWEST for rows in of):
            pairs.append([((found.time_ns[rows] - found.time_ns[0]) * 1e-9, found.position[rows]) for rows in of])
    if not pairs:
        return None
    coarse = np.array([_difference(pairs, float(lag)) for lag in LAGS])
    fine = LAGS[int(coarse.argmin())] + FINE
    scores = np.array([_difference(pairs, float(lag)) for lag in fine])
    best, without = float(fine[int(scores.argmin())]), _difference(pairs, 0.0)
    if not np.isfinite(scores.min()) or abs(best) < SHORTEST or without < BETTER * scores.min():
        return None
    return best


def _difference(pairs: list[list[tuple[np.ndarray, np.ndarray]]], lag: float) -> float:
    """Return the trimmed mean square of the distance between two cameras' paths at a lag [m^2]."""
    squares, count, whole = [], 0, 0
    for (times, path), (other_times, other_path) in pairs:
        at = other_times - lag
        after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
        inside = (at >= times[0]) & (at <= times[-1]) & (times[after] - times[after - 1] <= SPACED)
        count, whole = count + int(inside.sum()), whole + min(len(at), len(times))
        if inside.sum() < 2:
            continue
        there = np.stack([np.interp(at[inside], times, path[:, k]) for k in range(3)], axis=1)
        off = other_path[inside] - there
        squares.append(((off - np.median(off, axis=0)) ** 2).sum(axis=1))
    if count < max(FEWEST, OVERLAP * whole):
        return np.inf
    every = np.sort(np.concatenate(squares))
    return float(every[: max(int(KEPT * len(every)), 1)].mean())
