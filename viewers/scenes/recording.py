"""The scene of a recording, with the label and the prediction that belong to it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tacdata import documents, provenance
from tacdata.errors import UsageError
from tacdata.labels import file_names as label_names
from tacdata.recording.files import file_names
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.parts.label import ShownLabel, shown_label
from tacdata.viewers.parts.stretch_notes import with_stretch_notes
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

HAND_OVER = 2e-4
"""Longest that a thread keeps Python's lock while others wait for it [s]."""

if TYPE_CHECKING:
    from tacdata.recording.files.reader import Recording
    from tacdata.viewers.parts.recorded_images import ImageSampler


def recording_scene(path: Path, options: Asked) -> Scene:
    """Return the scene of a recording with the files of its folder. Raises as `viewers.source.scene_at`."""
    from tacdata.recording.files.reader import read_recording
    from tacdata.viewers.parts.recorded_images import ImageSampler

    sampler, limit = ImageSampler(), None if options.predictions else thinning.MAPS
    # Files are decoded without Python's lock, which others hold in the meantime.
    with _handing_over(), ThreadPoolExecutor(2) as pool:
        label_read = pool.submit(find_label, path, options.labels, limit)
        reading = pool.submit(read_recording, path, digests=False, seen=sampler.take)
        options.meanwhile()
        recording = reading.result()
        label, remarks = label_read.result()
    if path.name.endswith(file_names.PARTIAL):
        remarks.append("still being written, or left by a crash: this is what had reached the disk")
    scene = scene_of(recording, sampler, label, remarks, options.predictions)
    return with_stretch_notes(scene, path.parent, lambda: provenance.file_hash(path))


@contextmanager
def _handing_over() -> Iterator[None]:
    """Let threads hand Python's lock over often: at its usual 5 ms a reader waits longer than it reads."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(HAND_OVER)
    try:
        yield
    finally:
        sys.setswitchinterval(usual)


def scene_of(
    recording: Recording,
    sampler: ImageSampler,
    label: ShownLabel | None = None,
    remarks: Sequence[str] = (),
    predictions: Path | None = None,
) -> Scene:
    """Return the scene of a recording that was read, with the images that were kept.

    Raises as `viewers.source.scene_at`.
    """
    from tacdata.viewers.scenes.episode import episode_scene

    episode, remarks, prediction = recording.episode, list(remarks), None
    # A label of an earlier recording with the same name would be drawn at wrong times.
    if label is not None and not np.isin(label.time_ns, episode.taxels.sample_ns).any():
        remarks.append("the label's times are not those of this recording: run `tacdata label` again")
    if predictions is not None:
        prediction, remark = prediction_for(predictions, episode.taxels.sample_ns, episode.sensor.content_hash)
        remarks += remark
    images = sampler.images(tuple(episode.rig.get("cameras", {})))
    times = {name: (t.sample_ns, t.arrival_ns) for name, t in recording.cameras.items() if len(t.sample_ns)}
    unit = str(recording.board.get("unit") or "counts")
    return episode_scene(episode, label, prediction, images, tuple(remarks), times, unit)


def find_label(recording: Path, labels: Path | None, limit: int | None = None) -> tuple[ShownLabel | None, list[str]]:
    """Return a recording's label with ``limit`` maps or all, or None and, where it is known, why there is none.

    Raises:
        UsageError: If the folder that was asked for does not exist.
        FormatError: If the label is damaged.
    """
    if labels is not None and not labels.is_dir():
        raise UsageError(f"no folder {labels}", "the folder that `tacdata label` wrote", "run `tacdata label` first")
    folder = labels or label_names.folder(recording.parent)
    path, failure = label_names.label(folder, recording), label_names.failure(folder, recording)
    if path.is_file():
        return shown_label(path, limit), []
    if failure.is_file():
        return None, [f"labelling failed: {documents.read(failure, 'label_failure')['reason'].splitlines()[0]}"]
    return None, []


def prediction_for(folder: Path, time_ns: np.ndarray, sensor: str) -> tuple[PredictedMaps | None, list[str]]:
    """Return the prediction of an episode's frames, and remarks on it.

    Args:
        folder: Folder of predictions, or a training run.
        time_ns: Sample times of the episode's frames [ns], shape (n,).
        sensor: Content hash of its sensor.

    Raises:
        UsageError: If the folder holds no prediction at all.
        FormatError: If a file is damaged.
    """
    from tacdata.viewers.parts.prediction_files import find_prediction

    prediction = find_prediction(folder, time_ns)
    if prediction is None:
        words = f"no prediction of this episode in {folder.name}: networks are asked about test episodes"
        return None, [f"{words}; without --episode one of them is shown"]
    if prediction.sensor != sensor:
        return prediction, ["the prediction was made for another sensor description"]
    return prediction, []
