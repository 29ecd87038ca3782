"""States of a dataset's labels: complete, failed, waiting or stale episodes."""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tacdata import documents, schemas
from tacdata.dataset.format import folder, metadata

FILE = Path("meta/tacdata_labels.json")


@dataclass
class LabelledSession:
    """A session whose labels are appended to a dataset once finished."""

    name: str
    """Its folder."""
    episodes: tuple[str, ...]
    """Names of its recordings."""
    failed: dict[str, str] = field(default_factory=dict)
    """Recording -> reason why it is not in the dataset."""
    packed: set[str] = field(default_factory=set)
    """Recordings that are in the dataset."""


@dataclass(frozen=True)
class EpisodeState:
    """The state of one episode's label."""

    recording: str
    """Name of the recording."""
    state: str
    """``complete``, ``stale`` (made by another model version than the current one), ``failed`` or ``waiting``."""
    reason: str = ""
    """Why it failed or is stale."""


def update(root: Path, session: LabelledSession, models: dict[str, str]) -> None:
    """Write the states of a session; other sessions stay as they are. The caller locks the dataset.

    Args:
        root: Folder of the dataset.
        session: The session at present.
        models: Content hash of a sensor -> content hash of the current model.
    """
    document = read(root)
    document["models"] |= models
    document["sessions"][session.name] = {
        "episodes": list(session.episodes),
        "packed": sorted(session.packed),
        "failed": dict(session.failed),
    }
    document["updated_at"] = datetime.now(UTC).isoformat(timespec="seconds")
    documents.write(root / FILE, document, "dataset_labels")


def read(root: Path) -> dict[str, Any]:
    """Return the document (`schemas/dataset_labels.schema.json`), an empty one if there is none.

    Raises:
        FormatError: If it is damaged.
    """
    if (root / FILE).is_file():
        return documents.read(root / FILE, "dataset_labels")
    return {"version": schemas.version("dataset_labels"), "updated_at": "", "models": {}, "sessions": {}}


def models_in(root: Path) -> dict[str, str]:
    """Return which model made the labels of each sensor in a dataset, the last record's if they differ."""
    return {r.sensor: _model(r) for r in metadata.read_records(root).values()}


def states(root: Path, models: dict[str, str] | None = None) -> list[EpisodeState]:
    """Return the state of every episode that is in the dataset or was to be.

    Args:
        root: Folder of the dataset.
        models: Content hash of a sensor -> content hash of its model of now; None for those of the last labelling.

    Raises:
        UsageError: If there is no dataset.
        FormatError: If it is damaged.
    """
    counted = int(folder.read_info(root)["total_episodes"])
    document = read(root)
    current = document["models"] | (models or {})
    # A record whose append never finished counts for nothing; the next append of its recording writes it again.
    records = list(metadata.read_records(root).values())[:counted]
    result = []
    for record in records:
        model = current.get(record.sensor, _model(record))
        stale = _model(record) != model
        reason = f"made by model {_model(record)[:12]}…, the current one is {model[:12]}…" if stale else ""
        result.append(EpisodeState(record.recording_file, "stale" if stale else "complete", reason))
    for session in document["sessions"].values():
        packed = set(session["packed"])
        for name in session["episodes"]:
            if name in session["failed"]:
                result.append(EpisodeState(name, "failed", session["failed"][name]))
            elif name not in packed:
                result.append(EpisodeState(name, "waiting"))
    return result


def _model(record: metadata.EpisodeRecord) -> str:
    return str(record.label_provenance.get("parents", {}).get("model", ""))
