"""The head of a verdict: sentence, effect sizes, recordings and date. Text, page and picture begin with it."""

from __future__ import annotations

import re
import shlex
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tacdata.discrepancy.plain_number import plain_number
from tacdata.effects import Parameter, load
from tacdata.recording import read_session
from tacdata.recording.files.reader import read_recording
from tacdata.recording.session import FILE

MOST_WORDS = 30
"""Words of the sentence, at most."""
BREAKS = (r"(?<=[;.?]) ", r"(?<=:) ", r"(?<=,) ", " ")
"""Where a sentence may end, the best place first."""
Z90 = 1.645
"""Standard errors either way of a 90 % interval."""
EQUAL = 0.01
"""Places whose ranges differ by less have one size [1]."""
YEAR_2000 = 946684800
"""Seconds since 1970. Imported clocks may begin at zero: that is no date."""


@dataclass(frozen=True)
class Heading:
    """Recordings of a verdict, its folder, and the unit of its readings."""

    recordings: tuple[str, ...]
    """Recordings or folders of sessions, as they were given."""
    folder: str
    """Folder of the verdict."""
    recorded: str
    """When the first recording was made; empty where it is not stated."""
    unit: str
    """Unit of the readings."""

    @classmethod
    def of(cls, paths: list[Path], folder: Path) -> Heading:
        """Return the heading of a verdict of recordings."""
        unit, recorded = unit_of(paths[0])
        return cls(tuple(map(str, paths)), str(folder), recorded, unit)

    def document(self) -> dict[str, Any]:
        """Return it as in the verdict."""
        return {**asdict(self), "recordings": list(self.recordings)}

    def filled(self, command: str) -> str:
        """Return a command with this verdict's paths in place of the words that stand for them."""
        paths = " ".join(map(shlex.quote, self.recordings))
        folder = self.folder.rstrip("/")
        filled = command.replace("VERDICT", shlex.quote(folder)).replace("RECORDING...", paths)
        return filled.replace("NEW", shlex.quote(f"{folder}-revised"))


def unit_of(path: Path) -> tuple[str, str]:
    """Return the unit of a session's readings, and when its first recording was made; empty where it is not stated."""
    file = path if path.is_file() else None
    if file is None:
        file = read_session(path).episodes[0] if (path / FILE).is_file() else min(path.glob("*.mcap"))
    recording = read_recording(file)
    began = int(recording.episode.taxels.sample_ns[0]) * 1e-9
    date = datetime.fromtimestamp(began, UTC).strftime("%Y-%m-%d %H:%M") if began > YEAR_2000 else ""
    return str(recording.board.get("unit") or "counts"), date


def sentence(why: str) -> tuple[str, str]:
    """Return the first clauses of a reason, `MOST_WORDS` words at most, and the remainder.

    Example:
        >>> from tacdata.discrepancy.heading import sentence
        >>> sentence("a delay is there. Nothing else explains the presses as well")
        ('A delay is there. Nothing else explains the presses as well.', '')
    """
    head, tail = why, ""
    for between in BREAKS:
        head, tail = _first(re.split(between, why))
        if head:
            break
    return _closed(head), _closed(tail) if tail else ""


def _first(clauses: list[str]) -> tuple[str, str]:
    """Return the clauses that fit, joined, and the others."""
    count = 0
    for number, clause in enumerate(clauses):
        count += len(clause.split())
        if count > MOST_WORDS:
            return " ".join(clauses[:number]), " ".join(clauses[number:])
    return " ".join(clauses), ""


def _closed(words: str) -> str:
    """Return words as a sentence: a capital first, a full stop last."""
    words = words.strip().rstrip(";:,")
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "?")) else ".")


def sizes(verdict: dict[str, Any]) -> list[str]:
    """Return the size of each effect of a verdict with its unit and 90 % interval, a line each."""
    unit = verdict.get("heading", {}).get("unit", "")
    return [words for entry in verdict["effects"] if (words := _sized(entry, unit))]


def _sized(entry: dict[str, Any], unit: str) -> str:
    effect = load(entry["effect"])
    parts = []
    for p in effect.parameters:
        written = entry.get("parameters", {}).get(p.name)
        if written is None or written["error"] is None:
            continue
        values = written["value"] if isinstance(written["value"], list) else [written["value"]]
        value = max(values, key=abs)
        if written["error"] > abs(value):
            continue  # it is not known
        where = f" on the channel with most, of {len(values)}" if len(values) > 1 else ""
        if (whole := written.get("whole")) is not None:
            parts.append(f"{_whole(p, value, written['error'], whole, unit)}{where}")
            continue
        percent = p.unit == "1" and not p.grid and p.typical < 1
        parts.append(f"{p.meaning} {_interval(value, written['error'], _unit(p.unit, unit), percent)}{where}")
    return f"size of {effect.spoken}: {'; '.join(parts)}" if parts else ""


def _whole(parameter: Parameter, value: float, error: float, whole: dict[str, Any], unit: str) -> str:
    """Return a share as the size that it stands for: a length, or readings of the places with least and most."""
    meaning, low, high = parameter.meaning.split(" over ")[0].rstrip(","), whole["low"], whole["high"]
    unit = _unit(whole["unit"], unit)
    if high - low <= EQUAL * high:
        return f"{meaning} {_interval(high * value, high * error, unit, False)}"
    least, most = (plain_number(value * end, 3) for end in (low, high))
    return f"{meaning} {least} to {most} {unit}, {_interval(value, error, '', True)} of {parameter.of}"


def _unit(named: str, readings: str) -> str:
    """Return a parameter's unit in words."""
    if named in ("1", "reading"):
        return readings if named == "reading" else ""
    return f"of the {named}" if named.startswith("largest") else named


def _interval(value: float, error: float, unit: str, percent: bool) -> str:
    """Return a value with its unit and 90 % interval."""
    factor, unit = (100.0, "%") if percent else (1.0, unit)
    size, low, high = (plain_number(factor * (value + z * error), 3) for z in (0.0, -Z90, Z90))
    return f"{size} {unit}".rstrip() + f" (90 %: {low} to {high})"


def origin(verdict: dict[str, Any]) -> str:
    """Return session, dates and version of a verdict in a line; unknown parts are left out."""
    heading, stamp = verdict.get("heading", {}), verdict.get("provenance", {})
    names = [Path(path).name for path in heading.get("recordings", ())]
    parts = [f"session {', '.join(names)}"] if names else []
    parts += [f"recorded {heading['recorded']}"] if heading.get("recorded") else []
    parts += [f"judged {stamp['made_at'][:10]}"] if "made_at" in stamp else []
    parts += [f"tacdata {stamp['code_version']}"] if "code_version" in stamp else []
    return ", ".join(parts)
