"""A damaged recording, written anew with a summary, so that every MCAP reader opens it."""

from __future__ import annotations

import json
from pathlib import Path

from mcap.writer import CompressionType, Writer

from tacdata.errors import UsageError
from tacdata.provenance import code_version
from tacdata.recording.mcap_records import Records, read_records


def recover(path: Path, target: Path | None = None) -> tuple[Path, Records]:
    """Write what can be read of ``path`` beside it, as ``NAME.recovered.mcap``; the old file stays as it is.

    The copy says that it is not complete, names the damage, and keeps every message, time and attachment as
    it was.

    Returns:
        The new file and what was found in the old one (`Records.damage` is empty if nothing was wrong).

    Raises:
        UsageError: If there is no such file or the target exists.
        FormatError: If it is no MCAP file.
    """
    path = Path(path)
    records = read_records(path)
    target = target or path.with_name(path.name.removesuffix(".mcap") + ".recovered.mcap")
    try:
        stream = target.open("xb")
    except FileExistsError:
        raise UsageError(
            f"{target} exists", "a new file; nothing is overwritten", "remove it or name another with --out"
        ) from None
    with stream:
        _write(Writer(stream, compression=CompressionType.ZSTD), records)
    return target, records


def _write(writer: Writer, records: Records) -> None:
    writer.start(profile=records.profile, library=f"tacdata {code_version()}")
    for a in records.attachments.values():
        writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)
    schemas = {s.id: writer.register_schema(s.name, s.encoding, s.data) for s in records.schemas.values()}
    known = {
        c.id: writer.register_channel(c.topic, c.message_encoding, schemas.get(c.schema_id, 0), c.metadata)
        for c in records.channels.values()
    }
    orphans = 0
    for m in records.messages:
        if m.channel_id in known:
            writer.add_message(known[m.channel_id], m.log_time, m.data, m.publish_time, m.sequence)
        else:
            orphans += 1
    for name, values in records.metadata.items():
        writer.add_metadata(name, values)
    if records.damage or "episode" not in records.metadata:
        damage = [*records.damage, *([f"{orphans} messages without their channel"] if orphans else [])]
        before = records.metadata.get("episode", {}).get("reason", "")
        reason = "; ".join(filter(None, [before, "recovered", *damage]))
        writer.add_metadata("episode", {"complete": json.dumps(False), "reason": reason})
    writer.finish()
