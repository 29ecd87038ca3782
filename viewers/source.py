"""From a path to its scene, and what belongs to a recording."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from tacdata import documents
from tacdata.errors import UsageError
from tacdata.labels import Label, read_label
from tacdata.recording import file_names
from training.prediction import Prediction
from viewers.kinds.kind import Asked, kind_of
from viewers.scene import Scene


def scene_at(
    path: Path, labels: Path | None = None, predictions: Path | None = None, episode: int | None = None
) -> Scene:
    """Return the scene of a path.

    Args:
        path: A recording, session, dataset, demonstration, folder of targets, verdict or revision (`viewers.kinds`).
        labels: Folder of labels; without it ``labels`` beside the recording, if it is there.
        predictions: Folder of predictions, or a training run.
        episode: Its number in the folder; without it the first.

    Raises:
        UsageError: If there is nothing to view, or a named folder holds nothing.
        FormatError: If a file is damaged or of another sensor.
    """
    return kind_of(path).scene(path, Asked(labels, predictions, episode))


def recording_scene(path: Path, labels: Path | None, predictions: Path | None) -> Scene:
    """Return the scene of a recording with what lies beside it. Raises as `scene_at`."""
    from tacdata.recording.reader import read_recording
    from viewers.episode_scene import episode_scene
    from viewers.recorded_images import recorded_images

    with ThreadPoolExecutor(1) as beside:  # Arrow decodes the label while Python reads the recording
        found = beside.submit(find_label, path, labels)
        recording = read_recording(path)
        label, remarks = found.result()
    episode = recording.episode
    if label is not None and not np.isin(label.time_ns, episode.taxels.sample_ns).any():
        remarks.append("the label's times are not those of this recording: run `tacdata label` again")
    if path.name.endswith(file_names.PARTIAL):
        remarks.append("still being written, or left by a crash: this is what had reached the disk")
    prediction = None
    if predictions is not None:
        prediction, remark = prediction_for(predictions, episode.taxels.sample_ns, episode.sensor.content_hash)
        remarks += remark
    images = recorded_images(path, tuple(episode.rig.get("cameras", {})))
    times = {name: (t.sample_ns, t.arrival_ns) for name, t in recording.cameras.items() if len(t.sample_ns)}
    unit = str(recording.board.get("unit") or "counts")
    return episode_scene(episode, label, prediction, images, tuple(remarks), times, unit)


def find_label(recording: Path, labels: Path | None) -> tuple[Label | None, list[str]]:
    """Return a recording's label, or None and, where it is known, why there is none.

    Raises:
        UsageError: If the folder that was asked for does not exist.
        FormatError: If the label is damaged.
    """
    if labels is not None and not labels.is_dir():
        raise UsageError(f"no folder {labels}", "the folder that `tacdata label` wrote", "run `tacdata label` first")
    folder = labels or recording.parent / "labels"
    path, failure = folder / f"{recording.stem}.parquet", folder / f"{recording.stem}.failure.json"
    if path.is_file():
        return read_label(path), []
    if failure.is_file():
        return None, [f"labelling failed: {documents.read(failure, 'label_failure')['reason'].splitlines()[0]}"]
    return None, []


def prediction_for(folder: Path, time_ns: np.ndarray, sensor: str) -> tuple[Prediction | None, list[str]]:
    """Return the prediction of an episode's frames, and what should be said of it.

    Args:
        folder: Folder of predictions, or a training run.
        time_ns: Sample times of the episode's frames [ns], shape (n,).
        sensor: Content hash of its sensor.

    Raises:
        UsageError: If the folder holds no prediction at all.
        FormatError: If a file is damaged.
    """
    from viewers.prediction_files import find_prediction

    prediction = find_prediction(folder, time_ns)
    if prediction is None:
        return None, [f"no prediction of this episode in {folder.name}"]
    if prediction.sensor != sensor:
        return prediction, ["the prediction was made for another sensor description"]
    return prediction, []
