"""From recordings and a spec to a folder with the verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tacdata import documents, provenance
from tacdata.discrepancy.data.recordings import course_of, recordings_in
from tacdata.discrepancy.heading import Heading
from tacdata.discrepancy.judge import judge
from tacdata.discrepancy.model.spec import Spec
from tacdata.discrepancy.page.verdict_page import verdict_page
from tacdata.discrepancy.search.findings import STEPS
from tacdata.discrepancy.verdict import residual_table
from tacdata.discrepancy.verdict.before_and_after import beside_model
from tacdata.discrepancy.verdict.picture import draw
from tacdata.discrepancy.verdict.sealed import chosen
from tacdata.discrepancy.verdict.text import in_text
from tacdata.errors import UsageError
from tacdata.recording.check.figures import RecordingFigures, figures
from tacdata.recording.check.session import depth_findings
from tacdata.recording.files.reader import read_recording

VERDICT, TEXT, PICTURE, PAGE, SPEC = "verdict.json", "verdict.txt", "verdict.png", "verdict.html", "spec.json"
"""Files of the folder; the new spec only where something was named."""


@dataclass(frozen=True)
class Written:
    """Findings, and the path of their file."""

    verdict: dict[str, Any]
    text: str
    folder: Path


def run(
    paths: list[Path], spec: Spec, out: Path, note: Callable[[str], None] = lambda text: None, until: str = "decide"
) -> Written:
    """Judge recordings and write the verdict, a picture and, if effects were named, the next spec.

    Args:
        paths: Recordings or folders of sessions.
        spec: The model.
        out: Folder to create.
        note: Called with each step.
        until: The last step to make (`tacdata.discrepancy.search.findings.STEPS`).

    Raises:
        UsageError: If ``out`` exists, or there is nothing to read.
        FormatError: If recordings and spec do not fit together.
        KeyboardInterrupt: If interrupted; after the gate the verdict so far is written first.
    """
    if out.exists():
        raise UsageError(f"{out} exists", "a new folder", "choose another --out")
    if until not in STEPS:
        raise UsageError(f"step {until!r}", ", ".join(STEPS), "choose one of them for --stop-after")
    note("reading")
    course = course_of(paths)
    counts = Counter(path.name for path in paths)
    names = [path.name if counts[path.name] == 1 else str(path) for path in paths]
    hashes = {f"recording {name}": recording_hash(path) for name, path in zip(names, paths, strict=True)}
    parents = {"spec": spec.content_hash, **hashes}
    verdict = judge(course, spec, note, parents, until=until)
    heading = Heading.of(paths, out)
    following = [heading.filled(words) for words in verdict.document["next"]]
    remarks = [*_depth_remarks(paths), *verdict.document["remarks"]]
    document = verdict.document | {"heading": heading.document(), "next": following, "remarks": remarks}
    out.mkdir(parents=True)
    documents.write(out / VERDICT, document, "verdict")
    text = in_text(document)
    documents.write_text(out / TEXT, text)
    draw(verdict.found, verdict.before, verdict.after, document, out / PICTURE)
    residuals = beside_model(course, verdict.found, chosen(course))
    residual_table.write(out / residual_table.FILE, residuals, provenance.content_hash(document))
    documents.write_text(out / PAGE, verdict_page(document, residuals))
    if verdict.decision.status == "named":
        effects = [e.finding for e in verdict.decision.effects]
        revised = spec.with_effects([f.placed for f in effects], [f.error for f in effects], VERDICT)
        documents.write(out / SPEC, revised, "model_spec")
    if verdict.found.until != until:
        interrupt = KeyboardInterrupt()
        interrupt.add_note(f"  kept: {out}: {document['why']}")
        raise interrupt
    return Written(document, text, out)


def _depth_remarks(paths: list[Path]) -> list[str]:
    """Return the findings of `tacdata check` on depths: a machine that loses steps looks like many an effect."""
    groups: dict[Path, list[RecordingFigures]] = {}
    for path in paths:
        group = groups.setdefault(path if path.is_dir() else path.parent, [])
        group += [figures(read_recording(file)) for file in recordings_in(path)]
    found = [(folder, finding) for folder, entries in groups.items() for finding in depth_findings(entries)]
    return [f"{folder.name}: {finding.text}" for folder, finding in found]


def recording_hash(path: Path) -> str:
    """Return the content hash by which a verdict knows a recording, or a folder of them (hex)."""
    if path.is_file():
        return provenance.file_hash(path)
    return provenance.content_hash({p.name: provenance.file_hash(p) for p in sorted(path.glob("*.mcap"))})
