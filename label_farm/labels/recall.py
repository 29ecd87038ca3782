"""Remembers a session from the run before, so that a run reads only changed files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tacdata import provenance
from tacdata.errors import FormatError
from tacdata.label_farm.labels.label_index import Known, LabelIndex, stamp
from tacdata.sensor import Sensor

FLUSH = 500
"""Rows that are written at a time."""


def skin_key(skin: Sensor) -> str:
    """Return the hash of a whole sensor file, the parts too that a sensor's content hash leaves out."""
    return provenance.content_hash(skin.document)


class Recall:
    """The index of a session's labels, opened for one run."""

    def __init__(self, folder: Path) -> None:
        """Name the folder of the labels; nothing is known before `open`."""
        self._index = LabelIndex(folder)
        self._skins: dict[str, dict[str, Any]] = {}
        self._sensors: dict[str, Sensor] = {}
        self._made: dict[tuple[str, bool], str] = {}
        self._new: dict[str, Known] = {}
        self._near: dict[str, Known] = {}

    def open(self, given: Sensor | None, version_of: Callable[[Sensor], str]) -> None:
        """Open the index.

        Args:
            given: The skin that all are labelled with; None for each recording's own.
            version_of: Returns the hash of all that would decide a label of a skin now; may cost seconds.
        """
        if not self._index.open():
            return
        key_wanted = skin_key(given) if given else None
        for (skin, from_recording), document in self._index.skins().items():
            if (skin != key_wanted) if key_wanted else not from_recording:
                continue
            try:
                sensor = self._sensors[skin] = Sensor.from_document(document, "label index")
                self._made[skin, from_recording] = version_of(sensor)
            except FormatError:
                # A skin that this release cannot read has no current label.
                continue

    def prefetch(self, recordings: Sequence[Path]) -> None:
        """Look up some hundred recordings that will be asked for next, in one query."""
        self._near = self._index.find([path.name for path in recordings])

    def find(self, recording: Path) -> tuple[Known, Sensor] | None:
        """Return a recording's entry and its skin; None if the recording, the model or the code changed."""
        row = self._row(recording.name)
        if row is None or row.made != self._made.get((row.skin, bool(row.own))):
            return None
        # An empty stamp, or another one: the recording changed since.
        return (row, self._sensors[row.skin]) if row.source and row.source == stamp(recording) else None

    def note(self, row: Known, skin: Sensor) -> None:
        """Add an entry for a recording that was read."""
        if row.skin not in self._skins:
            self._skins[row.skin] = skin.document
        self._new[row.recording] = row
        self._near.pop(row.recording, None)
        self._flush_full()

    def note_current(self, recording: Path, label: Path) -> None:
        """Note that a recording's label is current."""
        row, current = self._row(recording.name), stamp(label)
        if row is not None and row.label != current:
            self._new[row.recording] = row._replace(label=current)
            self._flush_full()

    def _row(self, name: str) -> Known | None:
        return self._new.get(name) or self._near.get(name) or self._index.find([name]).get(name)

    def flush(self) -> None:
        """Write new entries."""
        if self._new:
            self._index.write(self._new.values(), self._skins)
            self._new.clear()
            self._index.open()

    def close(self) -> None:
        """Write new entries and close the index."""
        self.flush()
        self._index.close()

    def _flush_full(self) -> None:
        if len(self._new) >= FLUSH:
            self.flush()
