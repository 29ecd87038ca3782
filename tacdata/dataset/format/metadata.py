"""Metadata in addition to LeRobot's own: sensors, units and where each episode comes from.

LeRobot's edit tools drop files and columns that they do not know, so nothing here is trusted by its place:
the frame columns `tacdata.sensor` and `tacdata.record`, which every edit keeps, say which sensor and record
belong to a frame.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.dataset.format.features import UNITS, short_hash
from tacdata.errors import FormatError
from tacdata.plans import Press
from tacdata.sensor import Sensor

MAIN = Path("meta/tacdata.json")
RECORDS = Path("meta/tacdata_records.jsonl")
SHARD_KEY = b"tacdata"
TARE = "observation.state = observation.tactile_raw - its mean over the episode's rest phase [counts]"


@dataclass(frozen=True)
class EpisodeRecord:
    """Where one episode of a dataset comes from (`schemas/dataset_record.schema.json`)."""

    sensor: str
    """Content hash of the sensor."""
    recording: str
    """SHA-256 of the recording."""
    recording_file: str
    """File name of the recording."""
    label: str
    """SHA-256 of the label's values."""
    label_provenance: dict[str, Any]
    """Origin of the label."""
    press: dict[str, Any]
    """The nominal configuration as a document."""
    rig: str
    """Name of the rig."""
    virtual: bool
    """True if an emulated rig recorded it."""
    baseline: tuple[float, ...]
    """Mean reading of each taxel in the rest phase [counts], shape (taxels,)."""
    quality: float
    """Share of frames that are valid [1]."""
    complete: bool
    """False if the recording was interrupted or salvaged."""
    notes: tuple[str, ...] = ()
    """Remarks for the reader."""
    specimen: str = ""
    """Name of the sensor: of sensors of one design, whose descriptions are the same, each has its own."""
    simulated: dict[str, Any] | None = None
    """Simulation that drew the press and its specimen (`tacdata simulate`); None of a recording."""

    @cached_property
    def document(self) -> dict[str, Any]:
        """The record as plain data (JSON types)."""
        values = asdict(self)
        values |= {"baseline": list(self.baseline), "notes": list(self.notes)}
        if self.simulated is None:
            # Records of recordings keep the form, and the hash, that they had before there were simulations.
            del values["simulated"]
        return {"version": schemas.version("dataset_record"), **values}

    @cached_property
    def key(self) -> int:
        """Content of the column `tacdata.record`: decided by the content of measurement and label, not by time."""
        return short_hash(provenance.content_hash([self.sensor, self.recording, self.label]))

    @property
    def configuration(self) -> Press:
        """The press as a noun."""
        return Press.from_document(self.press)

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> EpisodeRecord:
        """Rebuild a record from a line of the file.

        Raises:
            FormatError: If the line breaks the schema.
        """
        documents.check(document, "dataset_record", origin)
        values: dict[str, Any] = {k: v for k, v in document.items() if k != "version"}
        values |= {"baseline": tuple(values["baseline"]), "notes": tuple(values["notes"])}
        return cls(**values)


def write_main(root: Path, sensors: dict[str, dict[str, Any]], rate: float) -> None:
    """Write meta/tacdata.json for sensor documents by content hash; ``rate`` in Hz."""
    stamp = provenance.stamp("tacdata.dataset", {}, {})
    made = {k: stamp[k] for k in ("made_by", "code_version", "made_at")}
    columns = {"rate": rate, "units": UNITS, "tare": TARE}
    documents.write(
        root / MAIN, {"version": schemas.version("dataset"), **made, **columns, "sensors": sensors}, "dataset"
    )


def read_main(root: Path) -> dict[str, Any] | None:
    """Return meta/tacdata.json, or None if an edit lost it.

    Raises:
        FormatError: If it is damaged, or a sensor document does not have the hash that it is filed under.
    """
    path = root / MAIN
    if not path.is_file():
        return None
    document = documents.read(path, "dataset")
    for digest, sensor in document["sensors"].items():
        if Sensor.from_document(sensor, f"{path}: sensors/{digest[:8]}").content_hash != digest:
            raise FormatError(
                f"{path}: the sensor filed under {digest[:8]} is not the one that it was filed for",
                "sensor documents as they were recorded",
                "put the original meta/tacdata.json back",
            )
    return document


def lost(root: Path) -> FormatError:
    """Return the error for a sensor that an edit lost, with the way to restore it."""
    return FormatError(
        f"{root} has no {MAIN}: the tool that last edited it dropped the sensor description and the units",
        f"a dataset with {MAIN} and {RECORDS}",
        f"tacdata dataset restore {quote(str(root))} SOURCE, with the dataset or datasets that it was made from",
    )


def append_record(root: Path, record: EpisodeRecord) -> None:
    """Append a record and bring it to the disk; a crash leaves at most an unfinished last line: ignored."""
    documents.check(record.document, "dataset_record", record.recording_file)
    path = root / RECORDS
    # A crash may have left half a line, which this record must not continue.
    torn = path.is_file() and path.stat().st_size > 0 and not path.read_bytes()[-1:] == b"\n"
    with path.open("a") as stream:
        stream.write(("\n" if torn else "") + provenance.canonical(record.document) + "\n")
        stream.flush()
        # On the disk before info.json counts the episode.
        os.fsync(stream.fileno())


def read_records(root: Path) -> dict[int, EpisodeRecord]:
    """Return the records by key; empty if an edit lost them. Unfinished lines are passed over."""
    path = root / RECORDS
    if not path.is_file():
        return {}
    records = {}
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
        try:
            document = json.loads(line)
        except ValueError:
            continue
        record = EpisodeRecord.from_document(document, f"{path}: line {number}")
        records[record.key] = record
    return records


def read_record(root: Path, key: int) -> EpisodeRecord | None:
    """Return the record of a key, checked; None if there is none. The others are not looked at closely."""
    path = root / RECORDS
    record = None
    for number, line in enumerate(path.read_text(errors="replace").splitlines() if path.is_file() else (), start=1):
        try:
            document = json.loads(line)
            identity = [document["sensor"], document["recording"], document["label"]]
        except (ValueError, KeyError, TypeError):
            continue
        if short_hash(provenance.content_hash(identity)) == key:
            record = EpisodeRecord.from_document(document, f"{path}: line {number}")
    return record


def shard_metadata(sensor: Sensor, record: EpisodeRecord) -> bytes:
    """Return the value of the key ``tacdata`` in a data file's Parquet metadata."""
    content = {
        "version": schemas.version("dataset"),
        "units": UNITS,
        "tare": TARE,
        "sensor_hash": sensor.content_hash,
        "sensor": sensor.document,
        "record": record.document,
    }
    return json.dumps(content).encode()
