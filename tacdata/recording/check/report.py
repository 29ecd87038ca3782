"""Checks a recording or a session: is it fit to be labelled and learned from?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import schemas
from tacdata.display import Displayed
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.recording.check.clocks import clock_words
from tacdata.recording.check.figures import RecordingFigures, figures
from tacdata.recording.check.findings import UNUSABLE, WARNING, Finding, findings
from tacdata.recording.check.imported import imported_summary, is_imported
from tacdata.recording.check.possible import ANSWER, CONTACT, answer
from tacdata.recording.check.session import session_findings, session_not_assessed
from tacdata.recording.files.reader import read_recording
from tacdata.recording.session import read_session

WEAK, FEWEST_PRESSES = 0.2, 4
"""Share of the usual change of the readings below which a press is named [1], of so many presses [count] or more."""


@dataclass(frozen=True, repr=False)
class Report(Displayed):
    """Result of a check: figures, findings, usable or not."""

    source: Path
    """File or folder that was checked."""
    episodes: tuple[RecordingFigures, ...]
    """Figures of every recording that could be read."""
    findings: tuple[Finding, ...]
    not_assessed: tuple[str, ...] = ()
    """Questions that the recordings leave open, and why, as sentences."""

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: verdict, findings."""
        verdict = "usable" if self.usable else "NOT usable as it is"
        yield f"Check of {self.source}: {len(self.episodes)} recordings, {verdict}"
        yield from (line.strip() for line in _grouped(self.findings))

    @property
    def usable(self) -> bool:
        """False if anything makes a recording unusable."""
        return not any(finding.severity == UNUSABLE for finding in self.findings)

    @property
    def document(self) -> dict[str, Any]:
        """The report as its file's document (`schemas/check.schema.json`)."""
        return {
            "version": schemas.version("check"),
            "source": self.source.name,
            "usable": self.usable,
            "findings": [asdict(finding) for finding in self.findings],
            "not_assessed": list(self.not_assessed),
            "episodes": [entry.document for entry in self.episodes],
        }

    @property
    def text(self) -> str:
        """The report as one page of text."""
        lines = [f"{self.source}: {len(self.episodes)} recordings"]
        imported = bool(self.episodes) and is_imported(self.episodes[0].recording.episode)
        summary = imported_summary(self.episodes) if imported else _summary(self.episodes)
        lines += [*_sync_words(self.episodes), *summary]
        lines += [f"  NOT ASSESSED  {text}" for text in self.not_assessed]
        lines += _grouped(self.findings) or ["nothing to remark"]
        return "\n".join([*lines, "usable" if self.usable else "NOT usable as it is"])


def check(path: StrPath) -> Report:
    """Check a recording or a session folder.

    Raises:
        UsageError: If it is neither.
        FormatError: If a single recording cannot be read, or the session's document is damaged.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.recording.check.report import check
        >>> report = check(Path("session"))
        >>> report.usable
        True
        >>> print(report.text)
        session: 2 recordings
          sync    not measured: taxels - motion (record --sync-tap)
          taxels  30.00 Hz, 340 frames, 0 lost, ...
        ...
        usable
    """
    path = Path(path)
    if path.is_file():
        entry = figures(read_recording(path))
        return Report(path, (entry,), tuple(findings(entry)), tuple(_not_assessed([entry])))
    if not path.is_dir():
        raise UsageError(f"no file or folder {path}", "a recording or a session folder", "check the path")
    session = read_session(path)
    entries, faults = [], []
    for file in session.episodes:
        try:
            entries.append(figures(read_recording(file)))
            faults += findings(entries[-1])
        except FormatError as error:
            faults.append(Finding(UNUSABLE, "recording", file.name, error.given))
    unknown = _not_assessed(entries)
    if entries and not is_imported(entries[0].recording.episode):
        unknown += session_not_assessed(entries)
    return Report(path, tuple(entries), (*faults, *_of_session(session, entries)), tuple(unknown))


def _of_session(session: Any, entries: list[RecordingFigures]) -> list[Finding]:
    faults = []
    if not session.episodes:
        faults.append(Finding(UNUSABLE, "session", "", "no finished recording"))
    if session.remaining:
        text = f"{len(session.remaining)} of {len(session.plan.presses)} presses of the plan are not recorded"
        faults.append(Finding(WARNING, "session", "", f"{text}; go on with tacdata record --resume"))
    if entries and is_imported(entries[0].recording.episode):
        return [*faults, *_unanswered(entries), *_weak(entries)]  # the positions of its channels may be stand-ins
    return [*faults, *session_findings(entries)]


def _unanswered(entries: list[RecordingFigures]) -> list[Finding]:
    pressed = [answer(entry) for entry in entries if entry.recording.episode.press.depth >= CONTACT]
    levels = [value for value in pressed if value is not None]
    if not levels or max(levels) >= ANSWER:
        return []
    text = f"no channel answers to any of {len(levels)} presses: at most {max(levels):.1f} times its noise"
    return [Finding(UNUSABLE, "taxels", "", text)]


def _weak(entries: list[RecordingFigures]) -> list[Finding]:
    """Name the presses of the same depth whose readings change far less than the others': they miss the skin."""
    pressed = [entry for entry in entries if entry.recording.episode.press.depth >= CONTACT]
    if len(pressed) < FEWEST_PRESSES:
        return []
    depths = np.array([entry.recording.episode.press.depth for entry in pressed])
    quantiles = [np.nanquantile(entry.recording.episode.taxels.counts, [0.02, 0.98], axis=0) for entry in pressed]
    # All channels together: which of them answers depends on the place.
    spans = np.array([float(np.linalg.norm(np.nan_to_num(high - low))) for low, high in quantiles])
    usual = float(np.median(spans))
    weak = np.flatnonzero((spans < WEAK * usual) & (depths > 0.8 * np.median(depths)))
    text = (
        f"the readings change by less than {100 * WEAK:.0f} % of what they do in other presses: did it miss the skin?"
    )
    return [Finding(WARNING, "taxels", pressed[k].recording.episode.path.name, text) for k in weak.tolist()]


def _not_assessed(entries: list[RecordingFigures]) -> list[str]:
    """Describe the questions that the recordings leave open."""
    pressed = [entry for entry in entries if entry.recording.episode.press.depth >= CONTACT]
    blind = sum(answer(entry) is None for entry in pressed)
    words = f"{blind} of {len(pressed)} presses have no rest, no contact or no noise to compare"
    return [f"whether the readings answer contact: {words}"] if blind else []


def _sync_words(entries: tuple[RecordingFigures, ...]) -> list[str]:
    """State how far every pair of streams may be off in time, or that it was not measured."""
    pairs: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        for pair in entry.document["sync"]:
            pairs.setdefault(f"{pair['first']} - {pair['second']}", []).append(pair)
    measured, unknown = [], []
    for name, series in pairs.items():
        estimates = [pair for pair in series if pair["offset"] is not None]
        if len(estimates) < len(series):
            unknown.append(name + (f" (in {len(series) - len(estimates)} of {len(series)})" if estimates else ""))
        if estimates:
            offset, uncertainty = (
                _middle(pair["offset"] for pair in estimates),
                max(pair["uncertainty"] for pair in estimates),
            )
            measured.append(f"{name} {offset:+.2f} +- {uncertainty:.2f} ms, taken off")
    lines = [f"  sync    {words}" for words in measured]
    imported = bool(entries) and is_imported(entries[0].recording.episode)
    why = "the source's times are taken as they are" if imported else "record --sync-tap"
    return [*lines, f"  sync    not measured: {', '.join(unknown)} ({why})"] if unknown else lines


def _summary(entries: tuple[RecordingFigures, ...]) -> list[str]:
    if not entries:
        return []
    documents = [entry.document for entry in entries]
    taxels, cnc = [d["taxels"] for d in documents], [d["cnc"] for d in documents]
    noise = [v for t in taxels for v in t["idle_noise"] if v is not None]
    answers = _middle(c["round_trip"] for c in cnc)
    lines = [
        f"  taxels  {_middle(t['rate'] for t in taxels):.2f} Hz, {sum(t['frames'] for t in taxels)} frames, "
        f"{sum(t['lost'] for t in taxels)} lost, {_outside(entries)} outside the commanded path, "
        f"idle noise {_middle(noise):.1f} counts",
        f"          {_arrival(entries)}; {clock_words(taxels[-1]['clock'], timing=False)}",
        f"  cnc     {_middle(c['rate'] for c in cnc):.1f} reports/s, start of a move known to "
        f"{_middle(c['start_uncertainty'] for c in cnc):.1f} ms, depth to "
        f"{max(c['depth_uncertainty'] for c in cnc):.3f} mm, "
        + (f"answers within {answers:.1f} ms" if np.isfinite(answers) else "answers not timed"),
    ]
    for name in sorted({name for d in documents for name in d["cameras"]}):
        views = [d["cameras"][name] for d in documents if name in d["cameras"]]
        lines.append(
            f"  camera {name}: {sum(v['images'] for v in views)} images, "
            f"{_middle(v['rate'] for v in views):.1f} Hz, {_seen(views)}"
        )
        lines.append(f"          {clock_words(views[-1]['clock'])}")
    return lines


def _outside(entries: tuple[RecordingFigures, ...]) -> int:
    """Return the number of readings before the start or after the end of their commanded path."""
    return sum(int((~entry.recording.episode.on_path).sum()) for entry in entries)


def _arrival(entries: tuple[RecordingFigures, ...]) -> str:
    """Return how late the readings arrived, over all recordings: the figures of the histogram in the picture."""
    lag = np.concatenate([entry.lag for entry in entries])
    if not lag.any():
        return "arrival times only"
    return f"arrival {np.mean(lag):.1f} ms after the sample, jitter {np.std(lag):.1f} ms, {np.max(lag):.0f} ms at most"


def _seen(views: list[dict[str, Any]]) -> str:
    """Describe one camera's sightings of its cube and of fingers, over several recordings."""
    fingers = sorted({finger for view in views for finger in view["fingers"]})
    looked = {finger: [v["fingers"][finger] for v in views if finger in v["fingers"]] for finger in fingers}
    if any(view["searched"] for view in views) or not fingers:
        looked = {"tags": views, **looked}
    words = []
    for what, entries in looked.items():
        searched = sum(entry["searched"] for entry in entries)
        sightings = sum(entry["searched"] * (entry["seen"] or 0.0) for entry in entries)
        words.append(f"{what} in view in {100 * sightings / max(searched, 1):.0f} % of {searched} searched")
    return ", ".join(words)


def _middle(values: Any) -> float:
    numbers = [value for value in values if value is not None]
    return float(np.median(numbers)) if numbers else float("nan")


def _grouped(faults: tuple[Finding, ...]) -> list[str]:
    """Return one line per finding; findings that several recordings share are merged."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for finding in faults:
        groups.setdefault((finding.severity, finding.stream, finding.text), []).append(finding.file)
    lines = []
    for (severity, stream, text), files in sorted(groups.items(), key=lambda item: item[0][0] != UNUSABLE):
        named = [name for name in files if name]
        where = named[0] if len(named) == 1 else f"{len(named)} recordings" if named else "session"
        lines.append(f"  {severity.upper():<8}  {stream}: {text} ({where})")
    return lines
