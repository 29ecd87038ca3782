"""What a path holds that can be viewed: a recording, a session or a dataset."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tacdata import documents
from tacdata.errors import UsageError
from tacdata.labels import Label, read_label
from tacdata.recording import file_names
from viewers.scene import Scene

RECORDING = ".mcap"
DATASET_MARK = Path("meta/info.json")
ALLOWED = "a recording (.mcap), a session folder or a dataset folder"


def scene_at(
    path: Path, labels: Path | None = None, predictions: Path | None = None, episode: int | None = None
) -> Scene:
    """Return the scene of one episode.

    Args:
        path: A recording, a session folder or a dataset folder.
        labels: Folder of labels; without it ``labels`` beside the recording, if it is there.
        predictions: Folder of predictions, or a training run.
        episode: Its number in the session or dataset; without it the first.

    Raises:
        UsageError: If there is nothing to view, or a named folder holds nothing.
        FormatError: If a file is damaged or of another sensor.
    """
    if path.is_file() and path.suffix == RECORDING:
        if episode is not None:
            raise UsageError(
                f"--episode {episode} with one recording",
                "--episode with a session or dataset",
                "leave it out",
            )
        return recording_scene(path, labels, predictions)
    if (path / DATASET_MARK).is_file():
        if labels is not None:
            raise UsageError("--labels with a dataset", "a dataset holds its labels", "leave it out")
        return _dataset(path, predictions, episode or 0)
    if path.is_dir():
        return recording_scene(_of_session(path, episode), labels, predictions)
    given = f"{path} is no recording" if path.exists() else f"no file or folder {path}"
    raise UsageError(given, ALLOWED, "check the path")


def recording_scene(path: Path, labels: Path | None, predictions: Path | None) -> Scene:
    """Return the scene of a recording with what lies beside it. Raises as `scene_at`."""
    from tacdata.recording.reader import read_episode
    from viewers.episode_scene import episode_scene
    from viewers.recorded_images import recorded_images

    episode = read_episode(path)
    label, remarks = find_label(path, labels)
    if label is not None and not np.isin(label.time_ns, episode.taxels.sample_ns).any():
        remarks.append("the label's times are not those of this recording: run `tacdata label` again")
    prediction = None
    if predictions is not None:
        prediction, remark = _prediction(predictions, episode.taxels.sample_ns, episode.sensor.content_hash)
        remarks += remark
    images = recorded_images(path, tuple(episode.rig.get("cameras", {})))
    return episode_scene(episode, label, prediction, images, tuple(remarks))


def find_label(recording: Path, labels: Path | None) -> tuple[Label | None, list[str]]:
    """Return a recording's label, or None and, where it is known, why there is none.

    Raises:
        UsageError: If the folder that was asked for does not exist.
        FormatError: If the label is damaged.
    """
    if labels is not None and not labels.is_dir():
        raise UsageError(
            f"no folder {labels}", "the folder that `tacdata label` wrote", "run `tacdata label` first"
        )
    folder = labels or recording.parent / "labels"
    path, failure = folder / f"{recording.stem}.parquet", folder / f"{recording.stem}.failure.json"
    if path.is_file():
        return read_label(path), []
    if failure.is_file():
        return None, [
            f"labelling failed: {documents.read(failure, 'label_failure')['reason'].splitlines()[0]}"
        ]
    return None, []


def _prediction(folder: Path, time_ns: np.ndarray, sensor: str):
    from viewers.prediction_files import find_prediction

    prediction = find_prediction(folder, time_ns)
    if prediction is None:
        return None, [f"no prediction of this episode in {folder.name}"]
    if prediction.sensor != sensor:
        return prediction, ["the prediction was made for another sensor description"]
    return prediction, []


def _of_session(folder: Path, episode: int | None) -> Path:
    finished = file_names.finished(folder)
    if not finished:
        broken = file_names.unfinished(folder)
        raise UsageError(
            f"{folder} holds no finished recording",
            ALLOWED,
            f"view one that was broken off: {broken[0]}" if broken else "check the path",
        )
    if episode is None:
        return next(iter(finished.values()))
    if episode not in finished:
        numbers = sorted(finished)
        known = ", ".join(map(str, numbers)) if len(numbers) <= 20 else f"{numbers[0]} to {numbers[-1]}"
        raise UsageError(f"--episode {episode}: not in {folder}", known, "choose one of them")
    return finished[episode]


def _dataset(folder: Path, predictions: Path | None, episode: int) -> Scene:
    from tacdata.dataset import features
    from tacdata.dataset.reader import read_dataset
    from viewers.dataset_scene import dataset_scene

    dataset = read_dataset(folder)
    prediction, remarks = None, []
    if predictions is not None and 0 <= episode < len(dataset.episodes):
        entry = dataset.episodes[episode]
        time = np.asarray(dataset[features.TIME][entry.start : entry.stop])
        prediction, remarks = _prediction(predictions, time, entry.sensor)
    return dataset_scene(dataset, episode, prediction, tuple(remarks))
