"""A camera that was bumped while recording: since when, by how much, and which of them it was.

Two cameras see the same fingers. If one is moved, the distance between their two paths jumps, and stays. Which of them
moved is decided by the fingers' motion: through the eyes of the moved camera every finger jumps, through those of the
other none does. From the bump on the moved camera's place is a state of the filter with a wide prior, as if it were
another camera. So its sightings still give the motion, and the other camera gives the place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.motion_filter import ProcessNoise, smooth
from tacdata.demonstrations.paths.sightings import CameraError, Sightings

SMALLEST = 0.0008
"""Smallest jump at the fingers that is looked for [m]."""
CLEAR = 5.0
"""Smallest jump, over its standard error [1]."""
EVIDENT = 12.0
"""Smallest log-likelihood ratio of a step in the camera's place against none [nats]."""
LOCAL = 20
"""Pairs of sightings on each side of a bump that must show it: a jump, no slow slip [count]."""
AGREEING = 0.5
"""Share of a jump that these pairs must show [1]."""
SPACED = 0.2
"""Largest interval between sightings over which a camera's path is interpolated [s]."""
WINDOW = 3.0
"""Time on each side of a bump in which the motion shows which camera moved [s]."""
CANDIDATES = 4
"""Sightings on each side of the likeliest moment at which the bump may have been [count]."""
DECISIVE = 5.0
"""Difference of log-likelihoods that decides between two cameras [nats]."""
WIDE = 0.02, float(np.radians(2.0))
"""Smallest prior standard deviation of the place [m] and rotation [rad] of a camera whose images show a bump."""
ROOM = 3.0, 1.0
"""The same over the jump between two cameras [1]: of the one that moved, and of either of two."""
MARGIN = 60_000_000
"""Time by which a bump that shows between cameras may be earlier or later [ns]: about an image."""
MOST = 4
"""Largest number of bumps that are looked for in a recording [count]."""


@dataclass(frozen=True)
class Bump:
    """From a time on, one camera's pose differs from the one in its file."""

    camera: str
    begin_ns: int
    """First time at which it may be displaced [ns]."""
    sure_ns: int
    """First time at which it surely does [ns]; sightings in between are left out."""
    end_ns: int | None
    """Time of its return, or of its next displacement [ns]; None to the end."""
    size: float
    """Displacement of its sightings, at the fingers [m]."""
    words: str
    """Description of the bump, for a person."""
    room: float = 0.0
    """Prior standard deviation of the camera's place, over the size [1]; 0 if images show it."""

    @property
    def spread(self) -> tuple[float, float]:
        """Prior standard deviation of place [m] and rotation [rad]."""
        reach = self.room * self.size or max(WIDE[0], 2 * self.size)
        return reach, WIDE[1] * reach / WIDE[0]


def jumps(sightings: Mapping[str, Sightings], begin_ns: int) -> list[Bump]:
    """Return the bumps that show between cameras, by their time.

    Args:
        sightings: Finger -> its sightings.
        begin_ns: Beginning of the demonstration [ns], for words.
    """
    bumps: list[Bump] = []
    cameras = sorted({camera for series in sightings.values() for camera in series.camera})
    for reference, partner in combinations(cameras, 2):
        steps = _steps(_apart(sightings, reference, partner))
        for k, (moment, size) in enumerate(steps):
            # Another bump close by must not count as this one.
            first = max([_before(sightings, (reference, partner), moment), *(t for t, _ in steps[:k])])
            last = min([moment + WINDOW * 1e9, *(t for t, _ in steps[k + 1 :])])
            which, at, gain = _which(sightings, (reference, partner), moment, (first, last))
            if gain < EVIDENT:
                continue
            if any(b.camera in which and abs(b.sure_ns - at) < 1e9 for b in bumps):
                continue  # a third camera shows the same bump
            seconds, jump = (at - begin_ns) * 1e-9, f"{1000 * size:.1f} mm apart where they agreed before"
            if len(which) == 1:
                opposite = partner if which[0] == reference else reference
                words = f"it shows the fingers {jump}, against camera {opposite}"
            else:
                words = f"it and camera {{}} show the fingers {jump}, and the motion does not tell which of them moved"
            for name in which:
                opposite = partner if name == reference else reference
                start = f"camera {name} was moved {seconds:.1f} s after the beginning: "
                room = ROOM[len(which) - 1]
                bumps.append(Bump(name, at - MARGIN, at + MARGIN, None, size, start + words.format(opposite), room))
    return sorted(bumps, key=lambda bump: bump.begin_ns)


def split(sightings: Mapping[str, Sightings], bumps: Sequence[Bump]) -> dict[str, Sightings]:
    """Return sightings in which a camera that was moved is another camera, whose place is hardly known.

    Sightings of the moment itself are left out: where the camera stood then is not known.
    """
    divided = dict(sightings)
    for number, bump in enumerate(bumps):
        name = f"{bump.camera} (moved, {number + 1})"
        for finger, series in divided.items():
            moment = (series.time_ns >= bump.begin_ns) & (series.time_ns < bump.sure_ns)
            # During the bump itself the camera is in no place that could be named.
            series = series.where(~(moment & _of(series, bump.camera)))
            divided[finger] = series
            rows = _of(series, bump.camera) & (series.time_ns >= bump.sure_ns)
            if bump.end_ns is not None:
                rows &= series.time_ns < bump.end_ns
            if rows.any():
                divided[finger] = _renamed(series, rows, bump, name)
    return divided


def unmoved(sightings: Sightings) -> np.ndarray:
    """Return which sightings are of cameras at the places in their files, shape (p,), bool."""
    return np.array([" (moved" not in camera for camera in sightings.camera], bool)


def _before(sightings: Mapping[str, Sightings], cameras: tuple[str, str], moment: int) -> float:
    """Return since when sightings determine the place before a moment [ns]: earlier if fingers were hidden."""
    first = [moment - WINDOW * 1e9]
    for camera in cameras:
        times = np.sort(np.concatenate([series.time_ns[_of(series, camera)] for series in sightings.values()]))
        times = times[times < moment]
        first += [float(times[-min(len(times), LOCAL * len(sightings))])] if len(times) else []
    return min(first)


def _of(sightings: Sightings, camera: str) -> np.ndarray:
    """Return which sightings are of a camera, moved or not, shape (p,), bool."""
    return np.array([name.partition(" (moved")[0] == camera for name in sightings.camera], bool)


def _renamed(sightings: Sightings, rows: np.ndarray, bump: Bump, name: str) -> Sightings:
    cameras = tuple(name if hit else camera for hit, camera in zip(rows, sightings.camera, strict=True))
    viewpoint = sightings.cameras.get(bump.camera)
    # Without a stated error the camera's place is not known here; a turn about the fingers themselves does as well.
    place = sightings.position[rows].mean(axis=0) if viewpoint is None else viewpoint.place
    return replace(sightings, camera=cameras, cameras={**sightings.cameras, name: CameraError(place, bump.spread)})


def _apart(sightings: Mapping[str, Sightings], reference: str, partner: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return, for each finger, times [ns] at which one camera saw it and its distance from the other's path [m]."""
    pairs = []
    for series in sightings.values():
        rows, partner_rows = (
            np.array([camera == name for camera in series.camera], bool) for name in (reference, partner)
        )
        if min(rows.sum(), partner_rows.sum()) < 2:
            continue
        times, path, at = series.time_ns[partner_rows], series.position[partner_rows], series.time_ns[rows]
        upper = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
        near = (at >= times[0]) & (at <= times[-1]) & (times[upper] - times[upper - 1] <= SPACED * 1e9)
        begin = times[0]
        expected = np.stack([np.interp(at[near] - begin, times - begin, path[:, k]) for k in range(3)], axis=1)
        pairs.append((at[near], series.position[rows][near] - expected))
    return pairs


def _steps(pairs: list[tuple[np.ndarray, np.ndarray]]) -> list[tuple[int, float]]:
    """Return the times [ns] and sizes [m] of all steps of the distance: the clearest, then its neighbours."""
    steps, spans = [], [(-np.inf, np.inf)]
    while spans and len(steps) < MOST:
        first, last = spans.pop()
        inside = [(t[rows], d[rows]) for t, d in pairs if (rows := (t > first) & (t < last)).any()]
        step = _step(inside)
        if step is not None:
            steps.append(step)
            spans += [(first, step[0]), (step[0], last)]
    return sorted(steps)


def _step(pairs: list[tuple[np.ndarray, np.ndarray]]) -> tuple[int, float] | None:
    """Return the time [ns] and size [m] of the clearest step; None if there is none."""
    pairs = [(t, d) for t, d in pairs if len(t) >= 2 * LOCAL]
    if not pairs:
        return None
    moments = np.unique(np.concatenate([t for t, _ in pairs]))
    # Coarse first: every moment takes two medians of each finger.
    moments = moments[:: max(len(moments) // 200, 1)]
    costs = [_cost(pairs, moment) for moment in moments]
    best = int(np.argmin(costs))
    near = np.unique(np.concatenate([t for t, _ in pairs]))
    near = near[(near >= moments[max(best - 1, 0)]) & (near <= moments[min(best + 1, len(moments) - 1)])]
    at = int(min(near, key=lambda moment: _cost(pairs, moment)))
    jump, local, weight, variance = np.zeros(3), np.zeros(3), 0, 0.0
    for t, d in pairs:
        head, tail = d[t < at], d[t >= at]
        if min(len(head), len(tail)) < LOCAL:
            continue
        share = min(len(head), len(tail))
        jump += share * (np.median(tail, axis=0) - np.median(head, axis=0))
        local += share * (np.median(tail[:LOCAL], axis=0) - np.median(head[-LOCAL:], axis=0))
        weight += share
        for part in (head, tail):
            # Robust; a median of pairs that share sightings is known as well as a mean of a quarter of them.
            scatter = 1.4826 * np.median(np.abs(part - np.median(part, axis=0)), axis=0)
            variance += share**2 * float(scatter @ scatter) / (len(part) / 4)
    if not weight:
        return None
    jump, local = jump / weight, local / weight
    size = float(np.linalg.norm(jump))
    # A slow drift changes the distance far from any moment, and shows no step close to it.
    if size < max(SMALLEST, CLEAR * np.sqrt(variance) / weight) or local @ jump < AGREEING * size**2:
        return None
    return at, size


def _cost(pairs: list[tuple[np.ndarray, np.ndarray]], moment: float) -> float:
    """Return the sum of distances from the medians before and after a moment [m]: outliers hardly count."""
    total = 0.0
    for t, d in pairs:
        for part in (d[t < moment], d[t >= moment]):
            if len(part):
                total += float(np.abs(part - np.median(part, axis=0)).sum())
    return total


def _which(
    sightings: Mapping[str, Sightings], cameras: tuple[str, str], moment: int, span: tuple[float, float]
) -> tuple[tuple[str, ...], int, float]:
    """Return which of two cameras moved, both if the motion does not decide, when [ns], and the gain of likelihood."""
    near = {}
    for finger, series in sightings.items():
        window = (series.time_ns > span[0]) & (series.time_ns < span[1])
        window &= np.array([camera in cameras for camera in series.camera], bool)
        if window.sum() >= LOCAL:
            near[finger] = series.where(window)
    if not near:
        return cameras, moment, 0.0
    scores: dict[tuple[str, int], float] = {}
    without: dict[str, float] = {}
    for name, opposite in (cameras, cameras[::-1]):
        # The process noise by the other camera alone: that of both would contain the bump.
        noise = {finger: _noise(series, opposite) for finger, series in near.items()}
        times = np.unique(
            np.concatenate([series.time_ns[[camera == name for camera in series.camera]] for series in near.values()])
        )
        middle = int(np.searchsorted(times, moment))
        # Before the bump, too, the camera's place may be a little off: only the change counts.
        always = Bump(name, 0, 0, None, 0.0, "")
        without[name] = _likelihood(split(near, (always,)), noise)
        # The step of the distance is known to a few images; the likelihood decides between these.
        for at in times[max(middle - CANDIDATES, 0) : middle + CANDIDATES + 1]:
            bump = Bump(name, int(at), int(at), None, 0.0, "")
            scores[name, int(at)] = _likelihood(split(near, (replace(always, end_ns=int(at)), bump)), noise)
    best = max(scores, key=lambda key: scores[key])
    opposite = cameras[1] if best[0] == cameras[0] else cameras[0]
    rival = max((score for (name, _), score in scores.items() if name == opposite), default=-np.inf)
    gain = scores[best] - without[best[0]]
    # Where either camera alone shows a smooth motion, naming one would be a guess.
    if scores[best] - rival < DECISIVE:
        return cameras, moment, gain
    return (best[0],), best[1], gain


def _likelihood(sightings: Mapping[str, Sightings], noise: Mapping[str, ProcessNoise]) -> float:
    """Return the log-likelihood of all fingers' sightings [nats]."""
    none = np.zeros(0, np.int64)
    return sum(smooth(series, none, noise[finger], back=False).log_likelihood for finger, series in sightings.items())


def _noise(sightings: Sightings, camera: str) -> ProcessNoise:
    """Return the process noise that one camera alone saw: a bump of the other is no motion."""
    rows = np.array([name == camera for name in sightings.camera], bool)
    return choose(sightings.where(rows) if rows.sum() >= LOCAL else sightings)
