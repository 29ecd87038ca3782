"""Makes the columns of a dataset from an episode and its label."""

import hashlib
from collections.abc import Iterable

import numpy as np

from tacdata import provenance
from tacdata.dataset.format import features
from tacdata.dataset.format.metadata import EpisodeRecord
from tacdata.errors import FormatError
from tacdata.labels import Label
from tacdata.recording.episode import Episode
from tacdata.sensor import Sensor


def label_hash(label: Label) -> str:
    """Return the SHA-256 of a label's values (hex); provenance, with its time of making, does not count."""
    digest = hashlib.sha256()
    for values in (label.time_ns, label.tip, label.signed, label.taxel_force, label.force, label.error):
        digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()


def recording_hash(episode: Episode) -> str:
    """Return the SHA-256 of the recording's file, or of the readings if there is no file (hex)."""
    if episode.path.is_file():
        return provenance.file_hash(episode.path)
    digest = hashlib.sha256(np.ascontiguousarray(episode.taxels.sample_ns).data)
    digest.update(np.ascontiguousarray(episode.taxels.counts).data)
    return digest.hexdigest()


def check_pair(episode: Episode, label: Label, expected: dict[str, str | None]) -> None:
    """Refuse a label that is not of this recording, sensor or skin model.

    Args:
        episode: The recording.
        label: Its label.
        expected: Required parents: recording, sensor, model -> content hash, None if any will do.

    Raises:
        FormatError: Naming the difference.
    """
    where = f"label of {episode.path.name}"
    parents = label.provenance.get("parents", {})
    for name, digest in expected.items():
        if digest is not None and parents.get(name) != digest:
            have = parents.get(name)
            raise FormatError(
                f"{where}: made for {name} {have[:12] if have else 'unknown'}",
                f"{name} {digest[:12]}",
                "run `tacdata label` for this session and this sensor again",
            )
    if not np.array_equal(label.time_ns, episode.taxels.sample_ns):
        raise FormatError(
            f"{where}: {len(label.time_ns)} frames, the recording has {len(episode.taxels.sample_ns)}"
            if len(label.time_ns) != len(episode.taxels.sample_ns)
            else f"{where}: its times are not those of the recording's frames",
            "one label frame for each taxel frame, at its time",
            "run `tacdata label` for this session again",
        )


LOST = 1.8
"""A time between frames of so many usual ones has lost a frame [1]."""


def valid(episode: Episode) -> np.ndarray:
    """Return which frames follow their neighbour without loss and lie on the commanded path, (n,), bool.

    Imported readings may have no counter (-1): then a loss is detected by their times.
    """
    times, counter = episode.taxels.sample_ns, episode.taxels.counter
    follows = np.diff(counter, prepend=counter[:1] - 1) == 1
    if len(counter) > 1 and (counter < 0).all():
        step = np.diff(times)
        follows = np.append(True, step < LOST * np.median(step))
    return follows & episode.on_path


def episode_columns(episode: Episode, label: Label, extra: Iterable[str] = ()) -> dict[str, np.ndarray]:
    """Return the columns that `DatasetWriter.append` takes, for an episode and its label.

    Args:
        episode: The recording.
        label: Its label.
        extra: Which of `features.EXTRA` too.

    Raises:
        FormatError: If the readings cannot be tared, or the label lacks a requested column.
    """
    counts = episode.taxels.counts
    return {
        features.STATE: episode.tared.astype(np.float32),
        features.RAW: counts.astype(np.float32),
        features.DEPTH: label.depth.astype(np.float32),
        features.TIP: label.tip.astype(np.float32),
        features.FORCE: label.force,
        features.TAXEL_FORCE: label.taxel_force,
        features.LABEL_ERROR: label.error,
        features.TIME: label.time_ns,
        features.PHASE: episode.phase_at(label.time_ns),
        features.VALID: valid(episode),
        **{key: _extra(label, key) for key in extra},
    }


def _extra(label: Label, key: str) -> np.ndarray:
    values = getattr(label, features.EXTRA[key])
    if values is None:
        raise FormatError(
            f"its label has no {features.EXTRA[key]}", "a label that knows it", "see `tacdata label --help`"
        )
    flat = values.reshape(len(values), -1) if values.ndim > 1 else values
    return flat.astype(np.float32)


def episode_record(episode: Episode, label: Label, recording: str, sensor: Sensor) -> EpisodeRecord:
    """Return where the episode comes from; ``recording`` is its hash, ``sensor`` that of its label."""
    return EpisodeRecord(
        sensor=sensor.content_hash,
        recording=recording,
        recording_file=episode.path.name,
        label=label_hash(label),
        label_provenance=label.provenance,
        press=episode.press.document,
        rig=str(episode.rig.get("name", "")),
        virtual="clock" in episode.rig,
        baseline=tuple(episode.baseline.tolist()),
        quality=float(valid(episode).mean()),
        complete=episode.complete,
        notes=episode.notes,
        # The skin that was pressed: its label may be of the nominal one.
        specimen=episode.sensor.name,
    )
