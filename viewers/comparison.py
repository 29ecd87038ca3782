"""Compares two folders' labels or predictions of one episode."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.labels import file_names
from tacdata.sensor import Sensor
from tacdata.viewers.kinds.session import episode_of, spans
from tacdata.viewers.parts import signals
from tacdata.viewers.parts.label import shown_label
from tacdata.viewers.parts.prediction_files import find_prediction, first_predicted
from tacdata.viewers.scene.scene import Scene, Span
from tacdata.viewers.scenes.comparison import Side, maps_comparison
from tacdata.viewers.scenes.dataset import phase_spans


def labels_at(path: Path, folders: Sequence[Path], episode: int | None) -> Scene:
    """Return two versions of an episode's label; with one folder the session's own labels are the first.

    Raises:
        UsageError: If there are not two, or one has no label of the episode.
        FormatError: If a label is damaged or of another sensor.
    """
    from tacdata.recording.files.reader import read_episode

    if path.is_file():
        recording, session_labels = path, file_names.folder(path.parent)
    else:
        recording, session_labels = episode_of(path, episode), file_names.folder(path)
    # With one folder the question is what changed against the session's own labels.
    folders = _two([session_labels, *folders] if len(folders) == 1 else folders, "labels")
    recorded, sides = read_episode(recording), []
    for name, folder in zip(telling_names(folders), folders, strict=True):
        file = file_names.label(folder, recording)
        if not file.is_file():
            raise UsageError(f"no label {file}", f"a label of {recording.stem} in each folder", "run `tacdata label`")
        label = shown_label(file)
        sides.append(Side(name, label.time_ns, np.maximum(label.signed, 0.0)))
    _same_grid(sides, recorded.sensor)
    title = f"{recording.resolve().parent.name}/{recording.stem}: two labels"
    return maps_comparison(title, recorded.sensor, sides, phases=signals.spans(recorded.phases))


def predictions_at(path: Path, folders: Sequence[Path], episode: int | None) -> Scene:
    """Return two networks' maps of an episode, and each one's error where it has a label.

    Raises:
        UsageError: If there are not two, or one holds no prediction of the episode.
        FormatError: If a file is damaged, or a network was made for another sensor.
    """
    folders = _two(folders, "predictions")
    title, sensor, time, label, phases = _labelled(path, episode, folders)
    sides = []
    for name, folder in zip(telling_names(folders), folders, strict=True):
        prediction = find_prediction(folder, time)
        if prediction is None:
            raise UsageError(
                f"{folder} holds no prediction of {title}",
                "two networks that predicted the same episode",
                "choose another --episode, or run `tacdata evaluate` on this dataset",
            )
        sides.append(Side(name, prediction.time_ns, prediction.depth))
    _same_grid(sides, sensor)
    return maps_comparison(f"{title}: two networks", sensor, sides, label, phases)


def _labelled(
    path: Path, episode: int | None, folders: Sequence[Path]
) -> tuple[str, Sensor, np.ndarray, Side | None, tuple[Span, ...]]:
    """Return title, sensor, times [ns], label and phases of an episode of a dataset, session or recording."""
    if (path / "meta" / "info.json").is_file():
        from tacdata.dataset.format import features
        from tacdata.dataset.reader import read_dataset

        dataset = read_dataset(path)
        dataset.check_measured("networks side by side")
        # An episode that only one network predicted has nothing to compare.
        number = _common(dataset, folders) if episode is None else episode
        if not 0 <= number < len(dataset.episodes):
            raise UsageError(f"--episode {number}", f"0 to {len(dataset.episodes) - 1}", "choose one of them")
        entry = dataset.episodes[number]
        part = slice(entry.start, entry.stop)
        time = np.asarray(dataset[features.TIME][part])
        label = Side("label", time, np.asarray(dataset[features.DEPTH][part]))
        phases = phase_spans(time, np.asarray(dataset[features.PHASE][part]))
        return f"{path.resolve().name}/episode {number}", dataset.sensors[entry.sensor], time, label, phases
    from tacdata.recording.files.reader import read_episode

    if episode is None and path.is_dir():
        episode = first_predicted(folders[0], spans(path))
    recording = path if path.is_file() else episode_of(path, episode)
    recorded = read_episode(recording)
    file = file_names.label(file_names.folder(recording.parent), recording)
    label = None
    if file.is_file():
        label_maps = shown_label(file)
        label = Side("label", label_maps.time_ns, np.maximum(label_maps.signed, 0.0))
    title = f"{recording.resolve().parent.name}/{recording.stem}"
    return title, recorded.sensor, recorded.taxels.sample_ns, label, signals.spans(recorded.phases)


def _common(dataset, folders: Sequence[Path]) -> int:
    """Return the first episode that every folder predicted, else 0."""
    from tacdata.dataset.format import features

    for entry in dataset.episodes:
        time = np.asarray(dataset[features.TIME][entry.start : entry.stop])
        if all(find_prediction(folder, time) is not None for folder in folders):
            return entry.index
    return 0


def _two(folders: Sequence[Path], what: str) -> Sequence[Path]:
    if len(folders) != 2:
        raise UsageError(f"--{what} given {len(folders)} times", "twice", f"name two folders with --{what}")
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"no folder {folder}", f"a folder of {what}", "check the path")
    return folders


def _same_grid(sides: Sequence[Side], sensor: Sensor) -> None:
    for side in sides:
        if side.depth.shape[1:] != sensor.map.shape:
            raise FormatError(
                f"{side.name} has maps of {side.depth.shape[1:]} pixels",
                f"{sensor.map.shape} pixels, as the sensor {sensor.name} says",
                "compare what was made for one sensor",
            )


def telling_names(paths: Sequence[Path]) -> list[str]:
    """Return the shortest names that tell paths apart, from their ends; equal paths get numbers."""
    parts = [path.resolve().with_suffix("").parts for path in paths]
    for count in range(1, max(map(len, parts)) + 1):
        names = ["/".join(pieces[-count:]) for pieces in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{path.name} {k + 1}" for k, path in enumerate(paths)]


def array_of(path: Path, channels: int) -> tuple[tuple[int, int], str]:
    """Return columns and rows of a session's or recording's array, else one row of channels, and its readings' unit."""
    from tacdata.recording.files.reader import read_recording

    recording = read_recording(path if path.is_file() else episode_of(path, None))
    taxels, unit = recording.episode.sensor.taxels, str(recording.board.get("unit") or "counts")
    return ((taxels.columns, taxels.rows) if taxels.count == channels else (channels, 1)), unit
