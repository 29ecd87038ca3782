"""Appends finished labels to a LeRobot dataset, one whole episode at a time, while others are solved."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tacdata.dataset import frames, label_states
from tacdata.dataset.format import folder, metadata
from tacdata.dataset.pack import append_episode
from tacdata.dataset.writer import DatasetWriter
from tacdata.errors import UsageError
from tacdata.label_farm.labels.label_index import stamp
from tacdata.labels import file_names, read_label, table
from tacdata.recording.files.reader import read_episode
from tacdata.sensor import Sensor

SAY_SECONDS = 2.0
"""Least time between updates of the dataset's list of missing episodes."""


class DatasetFlow:
    """Appends one session's episodes to a dataset. Several processes may append to one: each append locks it."""

    def __init__(
        self,
        out: Path,
        session: Path,
        recordings: Sequence[Path],
        sensor: Sensor | None = None,
        labels: Path | None = None,
    ) -> None:
        """Prepare; the dataset is made by the first episode.

        Args:
            out: Folder of the dataset.
            session: Folder of the recordings, by which the dataset names it.
            recordings: Files of its recordings.
            sensor: The skin that labels are of, if not each recording's own.
            labels: Folder of the labels; None for ``session/labels``.

        Raises:
            UsageError: If ``out`` is something else than a dataset.
        """
        if out.exists() and not ((out / folder.INFO).exists() or (out / metadata.MAIN).exists()):
            raise UsageError(f"{out} is no dataset of tacdata", "a dataset, or a new folder", "name another folder")
        self._out, self._sensor, self._labels = out, sensor, labels or file_names.folder(session)
        # Recordings end in their number of six digits.
        self._recordings = {int(path.stem[-6:]): path for path in recordings}
        self._state = label_states.LabelledSession(session.name, tuple(path.name for path in recordings))
        self._writer: DatasetWriter | None = None
        self._stamp, self._said = "", 0.0
        self._models: dict[str, str] = {}

    def deliver(self, number: int, reason: str) -> None:
        """Append an episode with a label, or note why it has none.

        Raises:
            UsageError: If the dataset holds labels of another model version.
            FormatError: If the dataset is damaged or has other columns.
        """
        path = self._recordings[number]
        if not reason:
            with self._locked():
                reason = self._append(path)
        if reason:
            self._state.failed[path.name] = reason.splitlines()[0]
        else:
            self._state.failed.pop(path.name, None)
            self._state.packed.add(path.name)
        if time.monotonic() - self._said > SAY_SECONDS:
            self.say()

    def say(self) -> None:
        """Write which episodes of the session are not in the dataset."""
        if not self._out.exists():
            return
        with self._locked():
            label_states.update(self._out, self._state, self._models)
        self._said = time.monotonic()

    def _append(self, path: Path) -> str:
        """Append an episode; return why it cannot be packed, or ""."""
        label_path = file_names.label(self._labels, path)
        header = table.read_header(label_path)["provenance"]["parents"]
        writer = self._current_writer(header["sensor"])
        self._models[header["sensor"]] = header["model"]
        # Packed by a run that was stopped before it noted so.
        if writer is not None and header["recording"] in writer.recordings:
            return ""
        episode, label = read_episode(path), read_label(label_path)
        recording, skin = frames.recording_hash(episode), self._sensor or episode.sensor
        if header["recording"] != recording:
            return "the recording changed after it was labelled: label it again"
        frames.check_pair(
            episode, label, {"recording": recording, "sensor": skin.content_hash, "model": header["model"]}
        )
        if writer is None:
            writer = DatasetWriter.create(self._out, skin)
        elif writer.sensor != skin:
            writer = DatasetWriter.open(self._out, skin)
        self._refuse_other_model(writer, skin, header["model"])
        reason = append_episode(writer, episode, label, recording)
        self._writer, self._stamp = writer, stamp(self._out / folder.INFO)
        return reason

    def _current_writer(self, sensor: str) -> DatasetWriter | None:
        """Return the writer of the present dataset; another process may have appended meanwhile."""
        current = stamp(self._out / folder.INFO)
        if self._writer is not None and current == self._stamp and self._writer.sensor.content_hash == sensor:
            return self._writer
        if not self._out.exists():
            return None
        main = metadata.read_main(self._out)
        known = Sensor.from_document(next(iter((main or {"sensors": {"": None}})["sensors"].values())), "dataset")
        return DatasetWriter.open(self._out, known)

    def _refuse_other_model(self, writer: DatasetWriter, skin: Sensor, model: str) -> None:
        if writer is self._writer:
            return
        stored = label_states.models_in(self._out).get(skin.content_hash, model)
        if stored != model:
            raise UsageError(
                f"{self._out} holds labels of model {stored[:12]}… of this sensor",
                f"labels of one model version in a dataset; these are of {model[:12]}…",
                "let them flow into a new dataset; `tacdata farm dataset` says what is stale in the old one",
            )

    @contextmanager
    def _locked(self) -> Iterator[None]:
        self._out.parent.mkdir(parents=True, exist_ok=True)
        # Beside the dataset, which does not exist before its first episode.
        handle = os.open(self._out.parent / f".{self._out.name}.lock", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)
