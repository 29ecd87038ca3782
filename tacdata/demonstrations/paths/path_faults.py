"""Faults of a finger's sightings: gaps, poses that contradict the path, exchanged fingers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from tacdata.demonstrations.paths.motion_filter import GAP, Smoothed, logarithm
from tacdata.demonstrations.paths.sightings import Sightings, repeated
from tacdata.demonstrations.recording.reader import TIMELY
from tacdata.recording.episode import TagStream
from tacdata.tags.cube.pose import CubePose
from tacdata.tags.fingers import Finger
from tacdata.tags.mixups import handedness

TURNED = np.radians(20.0)
"""Angle to the path, at the same position, from which a sighting is a flip [rad]."""
LEAST = 5
"""Minimum number of sightings of a single tag for judging it [count]."""
NEAR = 0.5
"""Largest distance from another finger's path, over the distance of the two fingers, that counts as an exchange [1]."""
STANDING = 0.2
"""Share of the time for which fingers must be arranged like the other hand's, for a warning [1]."""

CONTRADICTING = 0.08
"""Share of a finger's sightings that contradict the others, from which it is reported [1]."""


def gaps(time_ns: np.ndarray, begin_ns: int, end_ns: int) -> list[tuple[int, int]]:
    """Return the gaps: where a finger is not seen for longer than `GAP`, as beginnings and ends [ns].

    Args:
        time_ns: Times of sightings that were used [ns], shape (p,), ascending.
        begin_ns: Beginning of the demonstration [ns].
        end_ns: Its end [ns].
    """
    edges = np.concatenate([[begin_ns], time_ns, [end_ns]])
    return [(int(a), int(b)) for a, b in pairwise(edges) if b - a > GAP * 1e9]


def turn_against(sightings: Sightings, path: Smoothed, times_ns: np.ndarray) -> np.ndarray:
    """Return the angle between each sighting and the path at the nearest grid time [rad], shape (p,); NaN outside."""
    nearest, angles = _nearest(times_ns, sightings.time_ns), np.full(len(sightings), np.nan)
    for k, (rotation, path_rotation) in enumerate(zip(sightings.rotation, path.rotation[nearest], strict=True)):
        if np.isfinite(path_rotation).all():
            angles[k] = np.linalg.norm(logarithm(rotation @ path_rotation.T))
    return angles


def wrong_tags(sightings: Sightings, path: Smoothed, times_ns: np.ndarray) -> tuple[dict[int, float], tuple[int, ...]]:
    """Return the tags that, seen alone, contradict the other tags, and by which angle [rad]: turned, or misnumbered.

    The path may rest on the wrong tag, if that one is seen most. So tags are grouped by their angle to the path, and
    the largest group is right. Of two equally large groups the more frequent one is right. Then only frequency speaks
    for it, and its tags are returned too; otherwise no tags are.
    """
    nearest = _nearest(times_ns, sightings.time_ns)
    turns: dict[int, list[np.ndarray]] = {}
    for k, ids in enumerate(sightings.ids):
        path_rotation = path.rotation[nearest[k]]
        if len(ids) == 1 and np.isfinite(path_rotation).all():
            turns.setdefault(ids[0], []).append(path_rotation.T @ sightings.rotation[k])
    means = {tag: _mean(rotations) for tag, rotations in turns.items() if len(rotations) >= LEAST}
    # Tags that agree with each other form groups. The largest group is right, and a tie cannot be decided.
    groups = [[b for b in means if _angle(means[a], means[b]) < TURNED] for a in means]
    if not groups:
        return {}, ()
    right = max(groups, key=lambda group: (len(group), sum(len(turns[tag]) for tag in group)))
    wrong = {tag: _angle(means[tag], means[right[0]]) for tag in sorted(means) if tag not in right}
    tied = any(len(group) == len(right) for group in groups if group[0] in wrong)
    return wrong, tuple(sorted(right)) if tied else ()


def _nearest(times_ns: np.ndarray, wanted_ns: np.ndarray) -> np.ndarray:
    """Return the index of the grid time nearest to each time."""
    upper = np.clip(np.searchsorted(times_ns, wanted_ns), 1, len(times_ns) - 1)
    return upper - ((wanted_ns - times_ns[upper - 1]) < (times_ns[upper] - wanted_ns))


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(logarithm(a @ b.T)))


def _mean(rotations: list[np.ndarray]) -> np.ndarray:
    """Return the median rotation, shape (3, 3): the one with the smallest sum of angles to the others."""
    # All pairs are compared, so some thirty rotations must do.
    sample = rotations[:: max(len(rotations) // 30, 1)]
    return sample[int(np.argmin([sum(_angle(a, b) for b in sample) for a in sample]))]


def flips(sightings: Sightings, accepted: np.ndarray, angle: np.ndarray, name: str) -> list[str]:
    """Describe the number and size of sightings flipped against the path."""
    outlier = ~accepted & (angle > TURNED)
    if not outlier.any():
        return []
    low, high = np.degrees(np.nanquantile(angle[outlier], [0.1, 0.9]))
    tags = Counter(t for ids, bad in zip(sightings.ids, outlier, strict=True) if bad for t in ids)
    which = ", ".join(f"tag {tag} in {count}" for tag, count in tags.most_common(3))
    return [
        f"{name}: {int(outlier.sum())} of {len(sightings)} sightings are turned by {low:.0f} to {high:.0f} deg against "
        f"the path and were left out ({which}): a mirrored pose of a single face, or a tag glued on turned"
    ]


def exchanges(
    sightings: dict[str, Sightings], paths: dict[str, Smoothed], times_ns: np.ndarray, begin_ns: int
) -> list[str]:
    """Describe where sightings of two fingers lie on each other's path: their numbers are exchanged."""
    remarks = []
    for finger, partner in combinations(sightings, 2):
        encounters = [
            _on_the_others_path(sightings[a], paths[a], paths[b], times_ns)
            for a, b in ((finger, partner), (partner, finger))
        ]
        # Both fingers: a single wrong tag puts only one onto the other's path.
        if all(len(times) >= 2 for times in encounters):
            moments = np.sort(np.concatenate(encounters))
            first, last = (moments[[0, -1]] - begin_ns) * 1e-9  # ty: ignore[unsupported-operator]
            remarks.append(
                f"{finger} and {partner} change places {first:.1f} s after the beginning (seen so until {last:.1f} s): "
                "the numbers of their cubes are exchanged"
            )
    return remarks


def _on_the_others_path(sightings: Sightings, track: Smoothed, rival: Smoothed, times_ns: np.ndarray) -> np.ndarray:
    """Return the times [ns] of outliers that lie much nearer to another finger's path than to their own."""
    refused = (
        ~track.accepted
        & (sightings.time_ns >= times_ns[0])
        & (sightings.time_ns <= times_ns[-1])
        & (sightings.timing <= TIMELY)
    )
    times = sightings.time_ns[refused]
    reference, alternative = (
        np.stack([np.interp(times, times_ns, path.position[:, k]) for k in range(3)], -1) for path in (track, rival)
    )
    distance = np.linalg.norm(reference - alternative, axis=1)
    deviation = np.linalg.norm(sightings.position[refused] - alternative, axis=1)
    return times[deviation < NEAR * distance]


def other_hand(paths: dict[str, Smoothed], fingers: dict[str, Finger], rate: float) -> list[str]:
    """Name the hand whose index and middle finger are arranged, along the whole path, as those of the other hand."""
    remarks = []
    for hand in ("left", "right"):
        # The paths are those of the fingertips: an offset of the tip would count twice.
        hand_fingers = {n: replace(f, tip=np.eye(4)) for n, f in fingers.items() if f.hand == hand and n in paths}
        if not {"index", "middle"} <= {f.kind for f in hand_fingers.values()}:
            continue
        step = max(round(rate / 10), 1)
        votes = Counter(
            _stands(hand_fingers, paths, k) for k in range(0, len(next(iter(paths.values())).position), step)
        )
        wrong = votes["left" if hand == "right" else "right"]
        if wrong > STANDING * max(wrong + votes[hand], 1):
            remarks.append(
                f"index and middle finger of the {hand} hand stand as those of the other hand in "
                f"{wrong / (wrong + votes[hand]):.0%} of the time: the hands' cubes are swapped, or these two fingers'"
            )
    return remarks


def _stands(fingers: dict[str, Finger], paths: dict[str, Smoothed], k: int) -> str:
    from scipy.spatial.transform import Rotation

    cubes = {
        name: CubePose(paths[name].position[k], Rotation.from_matrix(paths[name].rotation[k]).as_quat(), 0.0, 1, ())
        for name in fingers
        if np.isfinite(paths[name].position[k]).all()
    }
    return handedness(fingers, cubes)


def repeats(views: Iterable[TagStream], begin_ns: int) -> list[str]:
    """Describe which cameras repeated images."""
    moments: dict[str, set[int]] = {}
    for view in views:
        moments.setdefault(view.camera, set()).update(view.sample_ns[repeated(view)].tolist())
    return [
        f"camera {camera} repeated an image {len(times)} times from {(min(times) - begin_ns) * 1e-9:.1f} to "
        f"{(max(times) - begin_ns) * 1e-9:.1f} s: repeated images do not count; it hung, or its driver fills in for "
        "lost ones: check its cable and its rate"
        for camera, times in moments.items()
        if times
    ]


def contradictions(sightings: Sightings, path: Smoothed, begin_ns: int) -> list[str]:
    """Count the sightings that contradict the path, by camera, where they are more than `CONTRADICTING`."""
    # An image at a wrong time contradicts the others, whatever camera and tags do.
    left_out = ~path.accepted & (sightings.timing <= TIMELY)
    if left_out.mean() <= CONTRADICTING:
        return []
    each = {name: np.array([camera == name for camera in sightings.camera]) for name in dict.fromkeys(sightings.camera)}
    shares = {name: left_out[rows].mean() for name, rows in each.items()}
    worst = max(shares, key=lambda name: shares[name])
    rows = np.flatnonzero(left_out & each[worst])
    first, last = ((int(sightings.time_ns[row]) - begin_ns) * 1e-9 for row in (rows[0], rows[-1]))
    which = f", {shares[worst]:.0%} of those of camera {worst}" if len(each) > 1 else ""
    return [
        f"{sightings.finger}: {left_out.mean():.0%} of its sightings contradict the others and are left out{which}, "
        f"from {first:.1f} to {last:.1f} s: was a camera moved, or is a pose in the rig file old?"
    ]
