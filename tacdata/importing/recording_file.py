"""An imported press as an MCAP file like those of `tacdata record`."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log

from tacdata.importing.streams import Stream
from tacdata.plans import Press
from tacdata.recording.clocks.stream_pairs import stream_pairs
from tacdata.recording.episode import Phase
from tacdata.recording.files import file_names, topics
from tacdata.recording.files.chunked_file import ChunkedFile
from tacdata.schemas import tacdata_pb2 as pb
from tacdata.sensor import Sensor

STATE = "Imported"
"""Controller state of every imported position."""


@dataclass(frozen=True)
class ImportedPress:
    """Everything that one imported recording holds."""

    press: Press
    sensor: Sensor
    registration: dict[str, Any]
    """As in a rig file."""
    taxels: Stream
    position: Stream
    measured: tuple[Stream, ...]
    phases: tuple[Phase, ...]
    plan: dict[str, Any]
    record: dict[str, Any]
    """`schemas/import_record.schema.json`."""
    lost: int
    """Frames missing by the device's counter; -1 without one."""

    @property
    def rig(self) -> dict[str, Any]:
        """The stand-in for a rig file."""
        imported = {
            key: self.record[key] for key in ("name", "source", "trial", "mapping_hash", "stand_ins", "set_aside")
        }
        if specimen := self.record.get("specimen"):
            imported["specimen"] = specimen
        if kind := self.record["mapping"]["taxels"].get("channels_are"):
            imported["channels_are"] = kind
        return {"name": self.record["name"], "registration": self.registration, "imported": imported}

    @property
    def attachments(self) -> dict[str, Any]:
        """Name of each attachment and its document."""
        return {
            "press.json": self.press.document,
            "sensor.json": self.sensor.document,
            "rig.json": self.rig,
            "registration.json": self.registration,
            "plan.json": self.plan,
            "board.json": {
                "channels": len(self.taxels.names),
                "names": list(self.taxels.names),
                "unit": self.taxels.unit,
                "rate": {"nominal": self.taxels.stated_rate or self.sensor.taxels.rate, "unit": "Hz"},
            },
            # No controller is known: limits that bind nothing.
            "controller.json": {"settings": {}, "acceleration": [1e6] * 3, "max_rate": [1e6] * 3},
            "import.json": self.record,
        }


def write(path: Path, imported: ImportedPress) -> None:
    """Write one file; it gets its final name once complete.

    Raises:
        UsageError: If it exists.
    """
    file = ChunkedFile(file_names.partial(path))
    for topic, message in topics.FIXED.items():
        file.register(topic, message)
    for stream in imported.measured:
        file.register(topics.measured(stream.name), pb.Measured)
        file.describe(f"measured/{stream.name}", {"unit": stream.unit, "names": json.dumps(stream.names)})
    begin = int(imported.taxels.time_ns[0])
    for name, document in imported.attachments.items():
        file.attach(name, "application/json", json.dumps(document, indent=1).encode(), begin)
    for text in imported.record["notes"]:
        note = Log(level=Log.Level.WARNING, message=text, name="tacdata import")
        note.timestamp.FromNanoseconds(begin)
        file.add(topics.LOG, begin, begin, 0, note.SerializeToString())
    for topic, time_ns, data in _messages(imported):
        file.add(topic, time_ns, time_ns, 0, data)
    received, lost = len(imported.taxels.time_ns), max(imported.lost, 0)
    counts = {"received": received, "lost": lost, "notes": imported.record["notes"]}
    file.describe("stream_counts/taxels", {key: json.dumps(value) for key, value in counts.items()})
    file.describe("sync", {pair.name: pair.words for pair in stream_pairs({"taxels": None})})
    file.describe("episode", {"complete": "true", "reason": ""})
    file.close()
    file.path.rename(path)


def _messages(imported: ImportedPress) -> Iterator[tuple[str, int, bytes]]:
    """Yield topic, time and bytes of every row of every stream, in the order of time."""
    makers: list[tuple[str, Stream, Callable[[int, list[float]], bytes]]] = [
        (topics.TAXELS, imported.taxels, _taxels),
        (topics.STATUS, imported.position, _status),
        *((topics.measured(stream.name), stream, _measured) for stream in imported.measured),
    ]
    marks = [(p.start_ns, p.name) for p in imported.phases]
    marks += [(imported.phases[-1].end_ns, "")] if imported.phases else []
    for time_ns, name in marks:
        yield topics.PHASE, time_ns, pb.Phase(name=name, start_ns=time_ns).SerializeToString()
    times = np.concatenate([stream.time_ns for _, stream, _ in makers])
    kind = np.repeat(np.arange(len(makers)), [len(stream.time_ns) for _, stream, _ in makers])
    row = np.concatenate([np.arange(len(stream.time_ns)) for _, stream, _ in makers])
    values = [stream.values.tolist() for _, stream, _ in makers]
    order = np.argsort(times, kind="stable")
    for t, k, r in zip(times[order].tolist(), kind[order].tolist(), row[order].tolist(), strict=True):
        topic, _, make = makers[k]
        yield topic, t, make(t, values[k][r])


def _taxels(time_ns: int, values: list[float]) -> bytes:
    message = pb.Taxels(arrival_ns=time_ns, sample_ns=time_ns, counter=-1, counts=values, device_ns=-1)
    return message.SerializeToString()


def _status(time_ns: int, values: list[float]) -> bytes:
    x, y, z = values
    position = pb.Vector3(x=x, y=y, z=z)
    return pb.CncStatus(sent_ns=time_ns, arrival_ns=time_ns, state=STATE, position=position).SerializeToString()


def _measured(time_ns: int, values: list[float]) -> bytes:
    return pb.Measured(arrival_ns=time_ns, sample_ns=time_ns, values=values).SerializeToString()
