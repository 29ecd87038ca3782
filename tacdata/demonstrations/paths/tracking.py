"""Turns a recorded demonstration into fingertip paths on one grid, and reports what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata import provenance
from tacdata.demonstrations import touch
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.demonstrations.paths import path_faults
from tacdata.demonstrations.paths.acquisition import acquire
from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.motion_filter import GATE, Smoothed
from tacdata.demonstrations.paths.second_look import why_nothing_is_seen
from tacdata.demonstrations.paths.sightings import FLOOR, Sightings, sightings_of
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import FormatError, UsageError
from tacdata.sensor import Sensor

RATE = 30.0
"""Default rate of the grid [Hz]."""
UNSEARCHED = "no image was searched for tags"
"""Beginning of a remark on a stretch without images."""
FEWEST = 5
"""Minimum number of sightings for a path."""


@dataclass(frozen=True)
class Estimator:
    """A trained network, as this room uses it."""

    identity: dict[str, Any]
    """Identity: hash, network, epoch, lookahead [frames], sensor hash."""
    sensor: Sensor
    maps: Callable[[np.ndarray], np.ndarray]
    """Function from tared readings of successive frames [counts], shape (m, taxels), to depth [mm], shape (m, pixels_x,
    pixels_y).
    """
    novelty: Callable[[np.ndarray], np.ndarray] | None = None
    """Function from tared readings to their novelty [1], shape (m,); None if it is not known."""


def track(recording: DemoRecording, rate: float = RATE, estimator: Estimator | None = None) -> Demonstration:
    """Smooth every finger's path, put the readings beside it, and report what is wrong.

    Args:
        recording: A demonstration.
        rate: Of the grid [Hz].
        estimator: A trained network, whose predicted depth is added for fingers with a board.

    Raises:
        UsageError: If the rate is not positive.
        FormatError: If no finger was seen often enough for a path, or the network is of another sensor.
    """
    if not 1.0 <= rate <= 1000.0:
        raise UsageError(f"a grid of {rate:g} Hz", "1 to 1000 Hz", "choose another rate")
    begin, end = recording.span_ns
    times = begin + np.rint(np.arange(int((end - begin) * 1e-9 * rate) + 1) * (1e9 / rate)).astype(np.int64)
    rig = recording.rig
    seen = {name: sightings_of(name, recording.views, rig, recording.timing) for name in rig.fingers}
    remarks = [f"while recording: {note}" for note in recording.notes]
    remarks += [f"{n}: seen in {len(s)} images, too few for a path" for n, s in seen.items() if len(s) < FEWEST]
    seen = {name: found for name, found in seen.items() if len(found) >= FEWEST}
    if not seen or len(times) < 2:
        raise _nothing_seen(recording)
    paths, settings = {}, {}
    # A finger can only be missing where an image was searched: these are the images' times.
    looked = np.unique(np.concatenate([view.sample_ns for view in recording.views]))
    for name, found in seen.items():
        seen[name], paths[name], settings[name], words = _path(found, times, looked)
        remarks += words
    if not recording.searched.startswith("all") and any(words.startswith(UNSEARCHED) for words in remarks):
        remarks.append("all images are stored: tacdata track --every-image searches those that were passed over")
    # These faults show between fingers, so all paths must be known first.
    remarks += path_faults.exchanges(seen, paths, times, begin)
    remarks += path_faults.other_hand(paths, recording.rig.fingers, rate)
    for name, stream in recording.taxels.items():
        remarks += touch.faults(name, stream, begin, end)
    tracks = {}
    for name, path in paths.items():
        tracks[name], words = _track(name, path, seen[name], recording, times, estimator)
        remarks += words
    parents = {"recording": provenance.file_hash(recording.path)}
    if estimator:
        parents["checkpoint"] = estimator.identity["hash"]
        if estimator.novelty is None:
            remarks.append(
                "whether these readings are like those that the network learnt from is not known: its run holds no "
                "seen.json of this checkpoint (tacdata train --resume on it writes one)"
            )
    return Demonstration(
        recording.path.name, parents["recording"], recording.task, recording.rig.frame, rate, times, tracks,
        recording.rig.sensors,
        {"gate": GATE, "floor": list(FLOOR), "fingers": settings, "searched": recording.searched},
        estimator.identity if estimator else None, tuple(dict.fromkeys(remarks)),
        provenance.stamp("tacdata track", parents, {"rate": rate}),
    )  # fmt: skip


def _nothing_seen(recording: DemoRecording) -> FormatError:
    why = why_nothing_is_seen(recording)
    return FormatError(
        f"{recording.path}: no finger was seen in {FEWEST} images" + (f"; {why.found}" if why else ""),
        "one finger with a visible cube, its tags of the family 36h11",
        why.remedy if why else "check light, focus, tag numbers and intrinsics with one image first",
    )


def _path(
    seen: Sightings, times: np.ndarray, looked: np.ndarray
) -> tuple[Sightings, Smoothed, dict[str, Any], list[str]]:
    """Smooth one finger, given the times of all searched images [ns], shape (p,).

    A tag that contradicts the others whenever it is seen alone is left out and named.
    """
    words: list[str] = []
    wander = choose(seen)
    path = acquire(seen, times, wander)
    wrong, rivals = path_faults.wrong_tags(seen, path, times)
    if wrong:
        words += _wrong_words(seen, wrong, rivals)
        kept = np.array([not (len(ids) == 1 and ids[0] in wrong) for ids in seen.ids])
        if kept.sum() >= FEWEST:
            seen = seen.where(kept)
            wander = choose(seen)
            path = acquire(seen, times, wander)
    angle = path_faults.turn_against(seen, path, times)
    words += path_faults.flips(seen, path.accepted, angle, seen.finger)
    begin = int(times[0])
    for a, b in path_faults.gaps(seen.time_ns[path.accepted], begin, int(times[-1])):
        first, last = (a - begin) * 1e-9, (b - begin) * 1e-9
        when = f"from {first:.1f} to {last:.1f} s ({last - first:.1f} s)"
        if ((looked > a) & (looked < b)).any():
            words.append(f"{seen.finger}: no tag that fits {when}")
        else:  # the recording person need not look for a hidden tag
            words.append(f"{UNSEARCHED} {when}: a camera or the host did not keep up")
    chosen = {"velocity_density": wander.velocity, "turning_density": wander.turning}
    return seen, path, {**chosen, "left_out_tags": list(wrong)}, words


def _wrong_words(seen: Sightings, wrong: dict[int, float], rivals: tuple[int, ...]) -> list[str]:
    """Describe which tags are left out, and whether the others may be wrong instead."""
    words = []
    for tag, angle in wrong.items():
        count, off = seen.ids.count((tag,)), f"{np.degrees(angle):.0f} deg"
        if rivals:
            others = " and ".join(map(str, rivals))
            words.append(
                f"{seen.finger}: tags {tag} and {others}, each seen alone, contradict each other: one of them "
                f"is glued on turned, or is another cube's, and the images do not tell which; tag {tag}, seen less "
                f"often ({count} images), is left out where it is alone: look at both"
            )
        else:
            words.append(
                f"{seen.finger}: tag {tag}, seen alone in {count} images, contradicts the others by {off}: it is glued "
                "on turned, or is another cube's; left out where it is alone"
            )
    return words


def _track(
    name: str, path: Smoothed, seen: Sightings, recording: DemoRecording, times: np.ndarray,
    estimator: Estimator | None,
) -> tuple[FingerTrack, list[str]]:  # fmt: skip
    from scipy.spatial.transform import Rotation

    finger, inside = recording.rig.fingers[name], np.isfinite(path.position).all(axis=1)
    quaternion = np.full((len(times), 4), np.nan)
    quaternion[inside] = Rotation.from_matrix(path.rotation[inside]).as_quat()
    # The smoother also gives poses inside a gap; they are marked as interpolated.
    gap = np.logical_not(inside)
    for a, b in path_faults.gaps(seen.time_ns[path.accepted], int(times[0]), int(times[-1])):
        gap = gap | np.asarray((times > a) & (times < b))
    signals, depth, novelty, words = None, None, None, []
    stream = recording.taxels.get(name)
    if stream is not None and len(stream.counts) > 1:
        tared = stream.counts - touch.baseline(stream)
        signals = touch.on_grid(stream, tared.astype(np.float32), times)
        if estimator is not None:
            _same_sensor(name, recording.rig.sensors[name], estimator)
            depth = touch.on_grid(stream, estimator.maps(tared), times)
            if estimator.novelty is not None:
                novelty = touch.on_grid(stream, estimator.novelty(tared), times)
                words += touch.unknown(name, signals, novelty)
            unfelt = int(np.isnan(signals[:, 0]).sum())
            if unfelt:
                words.append(f"{name}: no reading, so no predicted depth, at {unfelt} of {len(times)} times")
    made = FingerTrack(
        name, finger.hand, finger.kind, path.position, quaternion, path.covariance, gap, len(path.accepted),
        int((~path.accepted).sum()), signals, depth, novelty,
    )  # fmt: skip
    return made, words


def _same_sensor(name: str, sensor: Sensor, estimator: Estimator) -> None:
    if sensor.content_hash != estimator.sensor.content_hash:
        raise FormatError(
            f"{name} wears sensor {sensor.name} ({sensor.content_hash[:12]}), the network was trained for "
            f"{estimator.sensor.name} ({estimator.sensor.content_hash[:12]})",
            "a network of the sensor that the fingers wear", "name the right sensor in the demo rig, or train anew",
        )  # fmt: skip
