"""Turns a recorded demonstration into fingertip paths on one grid, and reports its faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tacdata import provenance
from tacdata.demonstrations import touch
from tacdata.demonstrations.demonstration import GUESS, Demonstration, FingerTrack
from tacdata.demonstrations.paths import path_faults
from tacdata.demonstrations.paths.acquisition import acquire
from tacdata.demonstrations.paths.background import without_bumps
from tacdata.demonstrations.paths.camera_bumps import unmoved
from tacdata.demonstrations.paths.estimator import Estimator, by_finger, identity_of
from tacdata.demonstrations.paths.image_order import in_order
from tacdata.demonstrations.paths.motion_density import choose
from tacdata.demonstrations.paths.motion_filter import GATE, Smoothed
from tacdata.demonstrations.paths.second_look import why_nothing_is_seen
from tacdata.demonstrations.paths.sightings import FLOOR, Sightings, sightings_of
from tacdata.demonstrations.paths.stream_times import (
    carried_through,
    check_together,
    in_step,
    late_stretches,
    late_words,
)
from tacdata.demonstrations.paths.touch_times import touch_lag
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import FormatError, UsageError

RATE = 30.0
"""Default rate of the grid [Hz]."""
UNSEARCHED = "no image was searched for tags"
"""Beginning of a remark on a stretch without images."""
FEW = 3
"""Maximum number of unsearched stretches that are named one by one."""
ENOUGH = 50
"""Searched images from which it is worth asking why no tag is seen."""
FEWEST = 5
"""Minimum number of sightings for a path."""


def track(
    recording: DemoRecording, rate: float = RATE, estimator: Estimator | Mapping[str, Estimator] | None = None
) -> Demonstration:
    """Smooth every finger's path, add the readings, and report the faults.

    Args:
        recording: A demonstration.
        rate: Of the grid [Hz].
        estimator: A trained network, or finger -> network, whose predicted depth is added for fingers with a board.

    Raises:
        UsageError: If the rate is not positive, or a network is for a finger without board.
        FormatError: If no finger was seen often enough for a path, streams share no time, or the network is of another
            sensor.
    """
    if not 1.0 <= rate <= 1000.0:
        raise UsageError(f"a grid of {rate:g} Hz", "1 to 1000 Hz", "choose another rate")
    check_together(recording)
    rig = recording.rig
    sightings = {name: sightings_of(name, recording.views, rig, recording.timing) for name in rig.fingers}
    recording, delays, delay_notes = in_step(recording, sightings)
    if delay_notes:
        sightings = {name: sightings_of(name, recording.views, rig, recording.timing) for name in rig.fingers}
    begin, end = recording.span_ns
    # A fault of time looks like a fault of cameras or tags, so it comes first.
    sightings, order_notes = in_order(sightings)
    sightings, stretch_notes = late_stretches(sightings, begin)
    original = sightings
    sightings, bumps = without_bumps(sightings, recording, delays)
    times = begin + np.rint(np.arange(int((end - begin) * 1e-9 * rate) + 1) * (1e9 / rate)).astype(np.int64)
    time_notes = [*delay_notes, *order_notes, *stretch_notes, *path_faults.repeats(recording.views, begin)]
    remarks = [*time_notes, *bumps, *(f"while recording: {note}" for note in recording.notes)]
    remarks += [f"{n}: seen in {len(s)} images, too few for a path" for n, s in sightings.items() if len(s) < FEWEST]
    sightings = {name: series for name, series in sightings.items() if len(series) >= FEWEST}
    if not sightings or len(times) < 2:
        raise _nothing_seen(recording)
    paths, settings = {}, {}
    # A finger can only be missing where an image was searched: these are the images' times.
    looked = np.unique(np.concatenate([view.sample_ns for view in recording.views]))
    unsearched: set[tuple[float, float]] = set()
    for name, series in sightings.items():
        sightings[name], paths[name], settings[name], words = _path(series, times)
        remarks += words
        remarks += path_faults.contradictions(sightings[name], paths[name], begin)
        # After the smoothing: as an error of each sighting, a common error of time would average out.
        paths[name] = carried_through(paths[name], sightings[name], times)
        # The sentence about a bump explains already why its moment is left out.
        doubted = np.setdiff1d(original[name].time_ns, series.time_ns)
        words, passed_over = _gaps(sightings[name], paths[name], times, looked, doubted)
        remarks += words
        unsearched |= passed_over
    remarks += late_words(sightings, begin)
    remarks += _unsearched_words(sorted(unsearched))
    if not recording.searched.startswith("all") and unsearched:
        remarks.append("all images are stored: tacdata track --every-image searches those that were passed over")
    # These faults show between fingers, so all paths must be known first.
    remarks += path_faults.exchanges(sightings, paths, times, begin)
    remarks += path_faults.other_hand(paths, recording.rig.fingers, rate)
    for name, stream in recording.taxels.items():
        remarks += touch.faults(name, stream, begin, end)
    tracks, estimators = {}, by_finger(estimator, tuple(recording.taxels))
    for name, path in paths.items():
        tracks[name], words = _track(name, path, sightings[name], recording, times, estimators.get(name))
        remarks += words
    # Paths of a camera that was moved show no time of closing fingers.
    if not bumps:
        tracks, words = _against_touch(tracks, paths, sightings, times)
        remarks += words
    parents = {"recording": provenance.file_hash(recording.path)}
    network = identity_of(estimators)
    if network:
        parents["checkpoint"] = network["hash"]
        remarks += [f"{name}: no network, so no predicted depth" for name in recording.taxels if name not in estimators]
        remarks += [
            predictor.identity["unfitted"] for predictor in estimators.values() if "unfitted" in predictor.identity
        ]
        # A network that is fitted to no unit learnt from no readings: its own remark names the remedy.
        if any(predictor.novelty is None and "unfitted" not in predictor.identity for predictor in estimators.values()):
            remarks.append(
                "whether these readings are like those that the network learnt from is not known: no seen.json of "
                "this checkpoint lies beside it; tacdata train writes one, unless validation presses hardly touch"
            )
    return Demonstration(
        recording.path.name,
        parents["recording"],
        recording.task,
        recording.rig.frame,
        rate,
        times,
        tracks,
        recording.rig.sensors,
        {"gate": GATE, "floor": list(FLOOR), "fingers": settings, "searched": recording.searched},
        network,
        tuple(dict.fromkeys(remarks)),
        provenance.stamp("tacdata track", parents, {"rate": rate}),
    )


def _against_touch(
    tracks: dict[str, FingerTrack], paths: dict[str, Smoothed], sightings: dict[str, Sightings], times: np.ndarray
) -> tuple[dict[str, FingerTrack], list[str]]:
    """Return tracks as uncertain as touch shows their times to be, and words about it."""
    lag = touch_lag(tracks, (times - times[0]) * 1e-9)
    if lag is None:
        return tracks, []
    if lag < 0:
        return tracks, [
            f"the readings are {-lag:.2f} s later than the images, by when the fingers close: depth belongs to earlier "
            "places than it stands at; record again on a host that keeps up, or correct the boards' latency"
        ]
    revision = {name: replace(series, timing=np.maximum(series.timing, lag)) for name, series in sightings.items()}
    judged = {
        name: replace(track, covariance=carried_through(paths[name], revision[name], times).covariance)
        for name, track in tracks.items()
    }
    return judged, [
        f"the images are {lag:.2f} s later than the readings, by when the fingers close: the paths are known no better "
        "than that; record again on a host that keeps up, or correct the cameras' latency in the demo rig"
    ]


def _nothing_seen(recording: DemoRecording) -> FormatError:
    looked = len({(view.camera, int(time)) for view in recording.views for time in view.sample_ns})
    if looked < ENOUGH and not recording.searched.startswith("all"):
        return FormatError(
            f"{recording.path}: no finger was seen in {FEWEST} images, as only {looked} were searched for tags while "
            "recording",
            f"{ENOUGH} images or more",
            "all images are stored: add --every-image to tacdata track",
        )
    why = why_nothing_is_seen(recording)
    return FormatError(
        f"{recording.path}: no finger was seen in {FEWEST} images" + (f"; {why.found}" if why else ""),
        "one finger with a visible cube, its tags of the family 36h11",
        why.remedy if why else "check light, focus, tag numbers and intrinsics with one image first",
    )


def _path(sightings: Sightings, times: np.ndarray) -> tuple[Sightings, Smoothed, dict[str, Any], list[str]]:
    """Smooth one finger; return its sightings, path, settings and faults.

    A tag that contradicts the others whenever it is seen alone is left out and named.
    """
    words: list[str] = []
    wander = choose(sightings)
    path = acquire(sightings, times, wander)
    wrong, rivals = path_faults.wrong_tags(sightings, path, times)
    if wrong:
        words += _wrong_words(sightings, wrong, rivals)
        mask = np.array([not (len(ids) == 1 and ids[0] in wrong) for ids in sightings.ids])
        if mask.sum() >= FEWEST:
            sightings = sightings.where(mask)
            wander = choose(sightings)
            path = acquire(sightings, times, wander)
    angle = path_faults.turn_against(sightings, path, times)
    words += path_faults.flips(sightings, path.accepted, angle, sightings.finger)
    densities = {"velocity_density": wander.velocity, "turning_density": wander.turning}
    return sightings, path, {**densities, "left_out_tags": list(wrong)}, words


def _gaps(
    sightings: Sightings, path: Smoothed, times: np.ndarray, looked: np.ndarray, doubted: np.ndarray
) -> tuple[list[str], set[tuple[float, float]]]:
    """Describe a finger's gaps; return those in which no image was searched apart, as begin and end [s].

    Args:
        sightings: Its sightings.
        path: Its path.
        times: The grid [ns], shape (n,).
        looked: Times of all searched images [ns], shape (p,).
        doubted: Times of sightings that are left out as a camera was just being moved [ns], shape (m,).
    """
    words, unsearched, begin = [], set(), int(times[0])
    for a, b in path_faults.gaps(sightings.time_ns[path.accepted], begin, int(times[-1])):
        if ((doubted > a) & (doubted < b)).any():
            continue
        first, last = (a - begin) * 1e-9, (b - begin) * 1e-9
        if ((looked > a) & (looked < b)).any():
            words.append(
                f"{sightings.finger}: no tag that fits from {first:.1f} to {last:.1f} s ({last - first:.1f} s)"
            )
        else:  # the recording person need not look for a hidden tag
            unsearched.add((round(first, 1), round(last, 1)))
    return words, unsearched


def _unsearched_words(stretches: list[tuple[float, float]]) -> list[str]:
    """Describe stretches without a searched image [s]: a few one by one, many in one sentence."""
    why = "a camera or the host did not keep up"
    if len(stretches) <= FEW:
        return [f"{UNSEARCHED} from {a:.1f} to {b:.1f} s ({b - a:.1f} s): {why}" for a, b in stretches]
    longest = max(stretches, key=lambda ends: ends[1] - ends[0])
    total, longest_for = sum(b - a for a, b in stretches), longest[1] - longest[0]
    return [
        f"{UNSEARCHED} in {len(stretches)} stretches of {total:.1f} s in all, the longest {longest_for:.1f} s from "
        f"{longest[0]:.1f} s on: {why}"
    ]


def _wrong_words(sightings: Sightings, wrong: dict[int, float], rivals: tuple[int, ...]) -> list[str]:
    """Describe which tags are left out, and whether the others may be wrong instead."""
    words = []
    for tag, angle in wrong.items():
        count, deviation = sightings.ids.count((tag,)), f"{np.degrees(angle):.0f} deg"
        if rivals:
            rival_tags = " and ".join(map(str, rivals))
            words.append(
                f"{sightings.finger}: tags {tag} and {rival_tags}, each seen alone, contradict each other: one of them "
                f"is glued on turned, or is another cube's, and the images do not tell which; tag {tag}, seen less "
                f"often ({count} images), is left out where it is alone: look at both"
            )
        else:
            words.append(
                f"{sightings.finger}: tag {tag}, seen alone in {count} images, contradicts the others by {deviation}: "
                "it is glued on turned, or is another cube's; left out where it is alone"
            )
    return words


def _misplaced(sightings: Sightings, path: Smoothed, times: np.ndarray) -> np.ndarray:
    """Return where only cameras that were moved saw the finger, and its place is a guess, shape (n,), bool."""
    steady = unmoved(sightings)
    if steady.all():
        return np.zeros(len(times), bool)
    lost = np.zeros(len(times), bool)
    for a, b in path_faults.gaps(sightings.time_ns[path.accepted & steady], int(times[0]), int(times[-1])):
        lost |= (times > a) & (times < b)
    spread = np.sqrt(np.max(np.diagonal(path.covariance[:, 3:, 3:], axis1=1, axis2=2), axis=1))
    return lost & ~(spread <= GUESS)


def _track(
    name: str,
    path: Smoothed,
    sightings: Sightings,
    recording: DemoRecording,
    times: np.ndarray,
    estimator: Estimator | None,
) -> tuple[FingerTrack, list[str]]:
    from scipy.spatial.transform import Rotation

    finger, inside = recording.rig.fingers[name], np.isfinite(path.position).all(axis=1)
    quaternion = np.full((len(times), 4), np.nan)
    quaternion[inside] = Rotation.from_matrix(path.rotation[inside]).as_quat()
    # The smoother also gives poses inside a gap; they are marked as interpolated.
    gap = np.logical_not(inside)
    for a, b in path_faults.gaps(sightings.time_ns[path.accepted], int(times[0]), int(times[-1])):
        gap = gap | np.asarray((times > a) & (times < b))
    gap = gap | _misplaced(sightings, path, times)
    signals, depth, novelty, words = None, None, None, []
    stream = recording.taxels.get(name)
    if stream is not None and len(stream.counts) > 1:
        tared = stream.counts - touch.baseline(stream)
        signals = touch.on_grid(stream, tared.astype(np.float32), times)
        if estimator is not None:
            estimator.check_sensor(name, recording.rig.sensors[name])
            depth = touch.on_grid(stream, estimator.maps(tared), times)
            if estimator.novelty is not None:
                novelty = touch.on_grid(stream, estimator.novelty(tared), times)
                words += touch.unknown(name, signals, novelty)
            unfelt = int(np.isnan(signals[:, 0]).sum())
            if unfelt:
                words.append(f"{name}: no reading, so no predicted depth, at {unfelt} of {len(times)} times")
    track = FingerTrack(
        name,
        finger.hand,
        finger.kind,
        path.position,
        quaternion,
        path.covariance,
        gap,
        len(path.accepted),
        int((~path.accepted).sum()),
        signals,
        depth,
        novelty,
    )
    return track, words
