"""Further quantities of a recording (force, temperature, ...) and its marked phases."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np

from tacdata.recording.episode import PHASES, MeasuredStream, Phase
from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import Records
from tacdata.schemas import tacdata_pb2 as pb


def measured_streams(records: Records) -> tuple[MeasuredStream, ...]:
    """Return every further quantity of a recording, by name."""
    measured = sorted({c.topic for c in records.channels.values() if c.topic.startswith(topics.MEASURED)})
    return tuple(_stream(records, topic.removeprefix(topics.MEASURED)) for topic in measured)


def _stream(records: Records, name: str) -> MeasuredStream:
    readings = [pb.Measured.FromString(message.data) for message in records.of_topic(topics.measured(name))]
    described = records.metadata.get(f"measured/{name}", {})
    names = tuple(json.loads(described.get("names", "[]"))) or (name,)
    values = np.array([list(r.values) for r in readings], dtype=float).reshape(-1, len(names))
    time_ns = np.array([r.sample_ns for r in readings], dtype=np.int64)
    return MeasuredStream(name, described.get("unit", ""), names, time_ns, values)


def marked_phases(records: Records) -> tuple[Phase, ...]:
    """Return the phases as they were marked, for recordings without motion commands."""
    marks = [pb.Phase.FromString(message.data) for message in records.of_topic(topics.PHASE)]
    return tuple(
        Phase(mark.name, mark.start_ns, following.start_ns)
        for mark, following in pairwise(marks)
        if mark.name in PHASES
    )
