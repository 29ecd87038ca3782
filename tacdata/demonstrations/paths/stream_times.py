"""Faults of the times of a recording's streams: gone astray, gone back, or one camera later than another.

Motion of the same fingers shows the lag of two cameras. The lag is the one at which both paths
differ least. Latency only makes images late, so the later camera is the wrong one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from tacdata.demonstrations.paths.motion_filter import Smoothed, logarithm
from tacdata.demonstrations.paths.sightings import LONGEST, Sightings, displaced
from tacdata.demonstrations.recording.reader import TIMELY, DemoRecording
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
"""Smallest lag that is reported [s]; the stated latencies are known to some milliseconds."""
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
LATE = 0.03
"""Standard uncertainty of image times from which a remark is made [s]."""
WINDOW, FEW = 3.0, 20
"""Stretch in which the lag of two cameras is looked for [s], and sightings of each that it must hold [count]."""
NEAR_LAGS = np.arange(-1.0, 1.0001, 0.02)
"""Lags that are tried in a stretch [s], shape (m,)."""
CLEARLY = 3.0
"""Smallest lag in a stretch, over the stated uncertainty of times [1]."""
STILL = 0.005
"""Smallest interval of images of which a speed is taken [s]."""
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
        # A camera has a stream for each finger, all on the camera's clock.
        device = name.split(" on ")[0]
        first, last = spans.get(device, (int(values[0]), int(values[-1])))
        spans[device] = min(first, int(values[0])), max(last, int(values[-1]))
    for device, (first, last) in spans.items():
        references = [span for key, span in spans.items() if key != device]
        if not references:
            continue
        begin, end = min(span[0] for span in references), max(span[1] for span in references)
        distance = max(first - end, begin - last) * 1e-9
        if distance > ASTRAY:
            side = "after" if first > end else "before"
            raise FormatError(
                f"{recording.path}: {device} lies {distance:.0f} s {side} all other streams",
                "streams of one time",
                "its clock or its latency is wrong: correct the rig file, and record again",
            )


def in_step(
    recording: DemoRecording, sightings: Mapping[str, Sightings]
) -> tuple[DemoRecording, dict[str, float], list[str]]:
    """Move images of a camera that is later than another; return the recording, camera -> by how much [s], and words.

    Args:
        recording: The recording.
        sightings: Finger -> its sightings.
    """
    cameras = sorted({camera for series in sightings.values() for camera in series.camera})
    delays: dict[str, float] = {}
    words = []
    for reference, partner in combinations(cameras, 2):
        lag = _lag(sightings, reference, partner)
        # Of three cameras, a pair with one that is moved already would move it twice.
        if lag is None or reference in delays or partner in delays:
            continue
        # The later one is moved: no image can be earlier than its exposure.
        slow, fast = (partner, reference) if lag > 0 else (reference, partner)
        delays[slow] = abs(lag)
        words.append(
            f"the images of camera {slow} are {abs(lag):.2f} s later than those of camera {fast}, by the motion that "
            "both saw: they are moved back by that; correct the camera's latency in the demo rig"
        )
    views = tuple(
        replace(view, sample_ns=view.sample_ns - round(delays.get(view.camera, 0.0) * 1e9)) for view in recording.views
    )
    timing = recording.timing | {name: max(RESIDUAL, recording.timing.get(name, 0.0)) for name in delays}
    return replace(recording, views=views, timing=timing) if delays else recording, delays, words


def late_stretches(sightings: Mapping[str, Sightings], begin_ns: int) -> tuple[dict[str, Sightings], list[str]]:
    """Return sightings with the uncertainty of times that two cameras' motion shows, and words about it.

    In a stretch in which the images of one camera are later than those of another, that lag is the uncertainty of its
    times. Two cameras with the same delay do not show it.

    Args:
        sightings: Finger -> its sightings.
        begin_ns: Beginning of the demonstration [ns], for words.
    """
    cameras = sorted({camera for series in sightings.values() for camera in series.camera})
    spans: dict[str, list[tuple[float, float, float]]] = {}
    times = np.concatenate([np.zeros(0, np.int64), *(series.time_ns for series in sightings.values())])
    if len(cameras) < 2 or not len(times):
        return dict(sightings), []
    # Stretches overlap by half, so that a short lateness lies whole in one of them.
    moments = np.arange(times.min(), times.max(), round(WINDOW / 2 * 1e9), dtype=np.int64)
    for reference, partner in combinations(cameras, 2):
        for first in moments:
            last = first + round(WINDOW * 1e9)
            part = {n: f.where((f.time_ns >= first) & (f.time_ns < last)) for n, f in sightings.items()}
            lag = _lag(part, reference, partner, NEAR_LAGS, FEW)
            laggard = partner if (lag or 0.0) > 0 else reference
            sigmas = [sigma for f in part.values() for sigma in f.timing[_by(f, laggard)]]
            if lag is not None and sigmas and abs(lag) > CLEARLY * float(np.median(sigmas)):
                spans.setdefault(laggard, []).append((float(first), float(last), abs(lag)))
    judged, words = dict(sightings), []
    for camera, stretches in spans.items():
        for name, series in judged.items():
            timing = series.timing.copy()
            for first, last, lag in stretches:
                rows = _by(series, camera) & (series.time_ns >= first) & (series.time_ns < last)
                timing[rows] = np.maximum(timing[rows], lag)
            judged[name] = replace(series, timing=timing, covariance=series.covariance + added(series, timing))
        ends = (
            (min(span[0] for span in stretches) - begin_ns) * 1e-9,
            (max(span[1] for span in stretches) - begin_ns) * 1e-9,
        )
        words.append(
            f"the images of camera {camera} are up to {max(span[2] for span in stretches):.2f} s later than those of "
            f"another between {ends[0]:.1f} and {ends[1]:.1f} s: the host did not keep up, and they hardly count there"
        )
    return judged, words


def timely(sightings: Sightings) -> Sightings:
    """Return the sightings whose times are known well enough to judge cameras and tags by them."""
    return sightings.where(sightings.timing <= TIMELY)


def carried_through(path: Smoothed, sightings: Sightings, times_ns: np.ndarray) -> Smoothed:
    """Return a path whose covariance holds the error of the images' times.

    Neighbouring images share their delay. So this error does not average out, as the noise of single images does. It is
    the distance that the finger goes in that time by its sightings: a smoothed path may have cut a stroke short.

    Args:
        path: A smoothed path.
        sightings: Its sightings.
        times_ns: The path's times [ns], shape (n,), ascending.
    """
    sigma, covariance = known_to(sightings, times_ns), path.covariance.copy()
    seconds, last = (times_ns - times_ns[0]) * 1e-9, len(times_ns) - 1
    displacement = _displacements(sightings, times_ns, sigma)
    for k in np.flatnonzero(np.isfinite(path.position).all(axis=1)):
        a, b = max(k - 1, 0), min(k + 1, last)
        turn = path.rotation[b] @ path.rotation[a].T
        turning = logarithm(turn) / (seconds[b] - seconds[a]) if np.isfinite(turn).all() and b > a else np.zeros(3)
        # By the path's velocity or by the sightings' own motion, whichever is larger: smoothing flattens a quick
        # stroke.
        smoothed = np.outer(path.velocity[k], path.velocity[k]) * sigma[k] ** 2
        covariance[k, :3, :3] += np.outer(turning, turning) * sigma[k] ** 2
        covariance[k, 3:, 3:] += max(smoothed, displacement[k], key=lambda matrix: float(np.trace(matrix)))
    return replace(path, covariance=covariance)


def known_to(sightings: Sightings, times_ns: np.ndarray) -> np.ndarray:
    """Return the standard uncertainty of time by the surest camera that sees the finger [s], shape (n,).

    Args:
        sightings: A finger's sightings.
        times_ns: Times [ns], shape (n,), ascending.
    """
    best = np.full(len(times_ns), np.inf)
    for camera in dict.fromkeys(sightings.camera):
        rows = _by(sightings, camera)
        times, sigma = sightings.time_ns[rows], np.minimum(sightings.timing[rows], LONGEST)
        upper = np.clip(np.searchsorted(times, times_ns), 1, max(len(times) - 1, 1))
        ends = [np.clip(upper - 1, 0, len(times) - 1), np.clip(upper, 0, len(times) - 1)]
        away = np.min([np.abs(times[k] - times_ns) for k in ends], axis=0)
        near = away <= SPACED * 1e9
        # Both images determine the path between them, so the less certain time counts.
        best[near] = np.minimum(best, np.max([sigma[k] for k in ends], axis=0))[near]
    # In a gap no image is near: the path there depends on the sightings at its ends.
    if len(sightings):
        nearest = np.clip(np.searchsorted(sightings.time_ns, times_ns), 1, max(len(sightings) - 1, 1))
        ends = np.maximum(sightings.timing[nearest - 1], sightings.timing[np.minimum(nearest, len(sightings) - 1)])
        best = np.where(np.isfinite(best), best, np.minimum(ends, LONGEST))
    return best


def late_words(sightings: Mapping[str, Sightings], begin_ns: int) -> list[str]:
    """Describe which cameras' image times are known badly, when, and the resulting error of moving fingers."""
    words = []
    for camera in sorted({camera.partition(" (")[0] for series in sightings.values() for camera in series.camera}):
        times, sigma, fastest = [], [], 0.0
        for series in sightings.values():
            rows = np.array([name.partition(" (")[0] == camera for name in series.camera], bool)
            if rows.sum() > 1:
                times, sigma = [*times, *series.time_ns[rows]], [*sigma, *series.timing[rows]]
                step = np.diff(series.time_ns[rows]) * 1e-9
                speed = np.linalg.norm(np.diff(series.position[rows], axis=0), axis=1) / np.maximum(step, STILL)
                # Not the largest speed: a mirrored pose jumps faster than any finger.
                fastest = max(fastest, float(np.quantile(speed, 0.99)))
        vague = np.array(sigma) > LATE
        if not vague.any():
            continue
        when, peak = np.array(times)[vague], min(float(np.max(sigma)), LONGEST)
        span = f" from {(when.min() - begin_ns) * 1e-9:.1f} to {(when.max() - begin_ns) * 1e-9:.1f} s"
        words.append(
            f"the times of camera {camera}'s images are known to {peak:.2f} s only{'' if vague.all() else span}: a "
            f"finger that moves is known to up to {1000 * peak * fastest:.0f} mm; record again on a host that keeps up,"
            " or with a camera that stamps its images"
        )
    return words


def _by(sightings: Sightings, camera: str) -> np.ndarray:
    """Return which sightings are of a camera, shape (p,), bool."""
    return np.array([name == camera for name in sightings.camera], bool)


def added(sightings: Sightings, timing: np.ndarray) -> np.ndarray:
    """Return the covariance that larger uncertainties of times add to sightings [m^2], shape (p, 6, 6)."""
    added = np.zeros((len(sightings), 6, 6))
    for camera in dict.fromkeys(sightings.camera):
        rows = _by(sightings, camera)
        times, places = sightings.time_ns[rows], sightings.position[rows]
        added[rows, 3:, 3:] = (
            displaced(times, places, times, timing[rows])
            # Uncertainties that have not grown are in the covariance already.
            * (timing[rows] > sightings.timing[rows]).astype(float)[:, None, None]
        )
    return added


def _displacements(sightings: Sightings, times_ns: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the covariance [m^2] of a finger's place that its sightings' times cause, shape (n, 3, 3)."""
    covariance = np.zeros((len(times_ns), 3, 3))
    for camera in dict.fromkeys(sightings.camera):
        rows = _by(sightings, camera)
        of_camera = displaced(sightings.time_ns[rows], sightings.position[rows], times_ns, sigma)
        larger = np.trace(of_camera, axis1=1, axis2=2) > np.trace(covariance, axis1=1, axis2=2)
        covariance[larger] = of_camera[larger]
    return covariance


def _lag(
    sightings: Mapping[str, Sightings], reference: str, partner: str, lags: np.ndarray = LAGS, fewest: int = FEWEST
) -> float | None:
    """Return how much later the images of another camera are than those of one [s]; None if they are not.

    Args:
        sightings: Finger -> its sightings.
        reference: A camera.
        partner: Another.
        lags: Lags that are tried [s], shape (m,).
        fewest: Smallest number of sightings of one that must fall on the other's path.
    """
    pairs = []
    for series in sightings.values():
        of = [np.array([camera == name for camera in series.camera]) for name in (reference, partner)]
        if all(rows.sum() >= fewest for rows in of):
            # From the first sighting on: float64 does not resolve nanoseconds since 1970.
            pairs.append([((series.time_ns[rows] - series.time_ns[0]) * 1e-9, series.position[rows]) for rows in of])
    if not pairs:
        return None
    coarse = np.array([_difference(pairs, float(lag), fewest) for lag in lags])
    fine = lags[int(coarse.argmin())] + FINE
    scores = np.array([_difference(pairs, float(lag), fewest) for lag in fine])
    # A lag has to explain the motion far better than none, or noise would choose one each time.
    best, without = float(fine[int(scores.argmin())]), _difference(pairs, 0.0, fewest)
    if not np.isfinite(scores.min()) or abs(best) < SHORTEST or without < BETTER * scores.min():
        return None
    return best


def _difference(pairs: list[list[tuple[np.ndarray, np.ndarray]]], lag: float, fewest: int) -> float:
    """Return the trimmed mean square of the distance between two cameras' paths at a lag [m^2]."""
    squares, count, total = [], 0, 0
    for (times, path), (other_times, other_path) in pairs:
        at = other_times - lag
        upper = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
        inside = (at >= times[0]) & (at <= times[-1]) & (times[upper] - times[upper - 1] <= SPACED)
        count, total = count + int(inside.sum()), total + min(len(at), len(times))
        if inside.sum() < 2:
            continue
        expected = np.stack([np.interp(at[inside], times, path[:, k]) for k in range(3)], axis=1)
        deviation = other_path[inside] - expected
        # A constant distance of the paths is an error of a camera's place and not of its time.
        squares.append(((deviation - np.median(deviation, axis=0)) ** 2).sum(axis=1))
    # A few common sightings agree at some lag by chance.
    if count < max(fewest, OVERLAP * total):
        return np.inf
    errors = np.sort(np.concatenate(squares))
    return float(errors[: max(int(KEPT * len(errors)), 1)].mean())
