"""The sync taps of a session: constant latencies that hold for the recordings after them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tacdata import documents, schemas
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.session import FILE, Session
from tacdata.recording.sync_tap.delays import SyncTap

CHANGE = 3.0
"""Minimum change of a latency that is reported [times its uncertainty]."""
LEAST_CHANGE_NS = 2_000_000
"""... and at least this much [ns]."""


def latencies(session: Session) -> dict[str, StreamLatency]:
    """Return the latest latency of each stream; {} without a sync tap."""
    result: dict[str, StreamLatency] = {}
    for entry in session.document.get("sync", []):
        result |= {name: StreamLatency.from_document(values) for name, values in entry["latencies"].items()}
    return result


def changes(session: Session, fresh: dict[str, StreamLatency]) -> tuple[str, ...]:
    """Describe the latencies that differ from an earlier sync tap of the session."""
    words = []
    for name, old in latencies(session).items():
        new = fresh.get(name, old)
        change = new.latency_ns - old.latency_ns
        threshold = CHANGE * (new.uncertainty_ns**2 + old.uncertainty_ns**2) ** 0.5
        if abs(change) > max(threshold, LEAST_CHANGE_NS):
            words.append(f"sync tap: the delay of {name} has changed by {change / 1e6:+.1f} ms; was a cable replugged?")
    return tuple(words)


def add_sync(session: Session, file: Path, tap: SyncTap) -> Session:
    """Write a sync tap into the session's document and return the session."""
    delays = {name: latency.document for name, latency in tap.latencies.items()}
    entry = {"file": file.name, "latencies": delays, "remarks": list(tap.remarks)}
    document = {
        **session.document,
        "version": schemas.version("session"),
        "sync": [*session.document.get("sync", []), entry],
    }
    documents.write(session.folder / FILE, document, "session")
    return replace(session, document=document)
