"""Lists the episodes of a session (plan, labels, check) or of a dataset (its records)."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata import documents
from tacdata.dataset import label_states
from tacdata.dataset.flags import read_flags
from tacdata.dataset.format import features, folder, metadata
from tacdata.dataset.notes import read_notes
from tacdata.errors import FormatError, TacdataError, UsageError
from tacdata.labels import file_names as label_names
from tacdata.recording.files import file_names
from tacdata.recording.session import read_session
from tacdata.training.inference.prediction import PredictedMaps, read_prediction
from tacdata.viewers.browse.episode_list import Entry, EpisodeList, Errors, errors_of, of_press, with_flags, with_notes
from tacdata.viewers.parts.label import shown_label
from tacdata.viewers.parts.prediction_files import prediction_paths


def episodes_at(path: Path, labels: Path | None = None, predictions: Path | None = None) -> EpisodeList:
    """Return the episodes of a session or dataset.

    Args:
        path: The folder.
        labels: A session's labels, else those inside it.
        predictions: Folder of predictions, or a training run: then each episode has an error if known.

    Raises:
        UsageError: If it is neither.
        FormatError: If a file is damaged.
    """
    if (path / folder.INFO).is_file():
        return _dataset(path, predictions)
    if not path.is_dir():
        raise UsageError(f"{path} is no folder", "a session or dataset folder", "check the path")
    return _session(path, labels or label_names.folder(path), predictions)


def _session(root: Path, labels: Path, predictions: Path | None) -> EpisodeList:
    session = read_session(root)
    presses = {press.index: press for press in session.plan.presses}
    checked, remarks = _checked(root)
    entries = []
    for number, path in file_names.finished(root).items():
        entry = of_press(number, path.name, presses.get(number))
        entries.append(replace(entry, label=_label_state(labels, path), quality=checked.get(path.name)))
    listing = with_notes(with_flags(tuple(entries), read_flags(root)), read_notes(root))
    if predictions is not None:
        listing = _with_session_errors(listing, labels, predictions)
    return EpisodeList(root, "session", listing, tuple(remarks))


def _checked(root: Path) -> tuple[dict[str, float], list[str]]:
    """Return the share of frames that came, by recording, as `tacdata check` counted them."""
    if not (root / "check.json").is_file():
        return {}, ["no check.json: `tacdata check` judges the recordings"]
    try:
        document = documents.read(root / "check.json", "check")
    except TacdataError as error:
        return {}, [f"check.json cannot be read: {error.given}"]
    shares = {}
    for entry in document["episodes"]:
        taxels = entry["taxels"]
        total = taxels["frames"] + taxels["lost"]
        shares[entry["file"]] = taxels["frames"] / total if total else 0.0
    # A recording that cannot be used has no good frames, however many came.
    for finding in document["findings"]:
        if finding["severity"] == "unusable" and finding["file"] in shares:
            shares[finding["file"]] = 0.0
    return shares, []


def _label_state(labels: Path, recording: Path) -> str:
    if label_names.label(labels, recording).is_file():
        return "complete"
    return "failed" if label_names.failure(labels, recording).is_file() else "none"


def _with_session_errors(entries: tuple[Entry, ...], labels: Path, predictions: Path) -> tuple[Entry, ...]:
    # Predictions are numbered by a dataset, recordings by their session: only times agree.
    by_start = {int(p.time_ns[0]): p for p in map(read_prediction, prediction_paths(predictions))}
    result = []
    for entry in entries:
        path = label_names.label(labels, Path(entry.file))
        label = shown_label(path) if entry.label == "complete" else None
        prediction = next((p for t, p in by_start.items() if label is not None and t in label.time_ns), None)
        errors = None
        if label is not None and prediction is not None:
            errors = errors_of(np.maximum(label.signed, 0), label.time_ns, prediction.depth, prediction.time_ns)
        result.append(_with_errors(entry, errors, prediction))
    return tuple(result)


def _with_errors(entry: Entry, errors: Errors | None, prediction: PredictedMaps | None) -> Entry:
    figures = asdict(errors) if errors else dict.fromkeys(("error", "centroid", "iou"))
    return replace(entry, **figures, part=prediction.part if prediction else "")


def _dataset(root: Path, predictions: Path | None) -> EpisodeList:
    rows = folder.read_rows(root, folder.read_info(root))
    records = metadata.read_records(root)
    keys = _record_keys(root, rows)
    states = label_states.read(root)
    entries = []
    for row in rows:
        record = records.get(keys.get(row.index, -1))
        if record is None:
            entries.append(Entry(row.index, "", label="complete"))
            continue
        entry = of_press(row.index, record.recording_file, record.configuration)
        model = record.label_provenance.get("parents", {}).get("model", "")
        # Labels of an older model stay in the dataset until they are made again.
        label = "complete" if states["models"].get(record.sensor, model) == model else "stale"
        entries.append(replace(entry, quality=record.quality, label=label, recording=record.recording))
    listing = with_notes(with_flags(tuple(entries), read_flags(root)), read_notes(root))
    if predictions is not None:
        listing = _with_dataset_errors(root, listing, predictions)
    absent = sum(len(set(session["episodes"]) - set(session["packed"])) for session in states["sessions"].values())
    drawn = sum(record.simulated is not None for record in records.values())
    remarks = (
        f"{drawn} simulated presses, nobody recorded them" if drawn else "",
        f"{absent} more are waiting for labels, or failed" if absent else "",
    )
    return EpisodeList(root, "dataset", listing, tuple(filter(None, remarks)))


def _record_keys(root: Path, rows: list[folder.EpisodeRow]) -> dict[int, int]:
    """Return which record each episode has, from the first frame of its file; episodes may share a file."""
    keys: dict[int, int] = {}
    for number in sorted({row.data_file for row in rows}):
        members = [row for row in rows if row.data_file == number]
        try:
            table = pq.ParquetFile(root / folder.data_path(number)).read([features.RECORD], use_threads=False)
        except (pa.ArrowException, OSError, KeyError) as error:
            reason = str(error).splitlines()[0]
            raise FormatError(
                f"{folder.data_path(number)} cannot be read: {reason}",
                "a data file",
                "take it from a copy, or pack the session again",
            ) from None
        # Row numbers count over all files, and each file begins with the first of its episodes.
        values, first = table.column(0), min(row.start for row in members)
        keys |= {row.index: int(values[row.start - first].as_py()) for row in members}
    return keys


def _with_dataset_errors(root: Path, entries: tuple[Entry, ...], predictions: Path) -> tuple[Entry, ...]:
    from tacdata.dataset.reader import read_dataset

    dataset = read_dataset(root)
    time, depth = dataset[features.TIME], dataset[features.DEPTH]
    by_start: dict[int, PredictedMaps] = {}
    for path in prediction_paths(predictions):
        prediction = read_prediction(path)
        by_start[int(prediction.time_ns[0])] = prediction
    result = []
    for entry, place in zip(entries, dataset.episodes, strict=True):
        part = slice(place.start, place.stop)
        own_time = np.asarray(time[part])
        prediction = next((p for t, p in by_start.items() if own_time[0] <= t <= own_time[-1]), None)
        errors = (
            errors_of(np.asarray(depth[part]), own_time, prediction.depth, prediction.time_ns) if prediction else None
        )
        result.append(_with_errors(entry, errors, prediction))
    return tuple(result)
