"""The episodes of a session or dataset as a list to choose from, without reading recorded data."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.dataset.flags import Flag
from tacdata.dataset.notes import Note
from tacdata.errors import UsageError
from tacdata.plans import Press


@dataclass(frozen=True)
class Entry:
    """One episode. Numbers that are not known are None."""

    number: int
    """In the session or dataset."""
    file: str
    """Name of the recording."""
    indenter: str = ""
    """The plan's name of the indenter."""
    shape: str = ""
    """Its shape."""
    x: float | None = None
    """Place [mm]."""
    y: float | None = None
    """Place [mm]."""
    depth: float | None = None
    """Nominal depth [mm]."""
    rate: float | None = None
    """Speed of the press [mm/s]."""
    quality: float | None = None
    """Share of frames that are valid, or that came [1]."""
    label: str = ""
    """State of the label: complete, stale, failed, waiting or none."""
    part: str = ""
    """Role in a network's training: train, validation, test."""
    error: float | None = None
    """Pixel root mean square error of a network over all frames [mm]."""
    centroid: float | None = None
    """Distance of the predicted contact's centroid from the label's, mean over the frames that have both [px]."""
    iou: float | None = None
    """Intersection over union of predicted and labelled contact, mean over the frames that have either [1]."""
    flag: str = ""
    """Why it is set aside; empty for one that is not."""
    notes: int | None = None
    """How many notes there are on stretches of it [count]."""
    recording: str = ""
    """SHA-256 of the recording's file, where it is known without reading it."""


UNITS = {"x": "mm", "y": "mm", "depth": "mm", "rate": "mm/s", "error": "mm", "centroid": "px"}
SHOWN = tuple(f.name for f in fields(Entry) if f.name != "recording")
"""Columns for listing, filtering and sorting."""
# The first that is found counts, so the signs of two characters come first.
OPERATORS: dict[str, Callable[[Any, Any], bool]] = {
    "!=": lambda a, b: a != b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "=": lambda a, b: a == b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
}
MOST_NAMED = 12
"""Values of a column that a remark names, at most."""
WORDS = frozenset(("file", "indenter", "shape", "label", "part", "flag"))


@dataclass(frozen=True)
class EpisodeList:
    """Content of a session or dataset."""

    root: Path
    kind: str
    """"session" or "dataset"."""
    entries: tuple[Entry, ...]
    remarks: tuple[str, ...] = ()
    """Remarks on the list."""

    def where(self, condition: str) -> EpisodeList:
        """Return those that fulfil a condition such as ``depth>0.8``, ``indenter=ball`` or ``flag=``.

        Raises:
            UsageError: If it cannot be understood.
        """
        key, sign, value = _parsed(condition)
        test = OPERATORS[sign]
        entries = tuple(e for e in self.entries if getattr(e, key) is not None and test(getattr(e, key), value))
        missing = bool(self.entries) and not entries
        remark = (f"no episode fits {condition}: {self.present(key)}",) if missing else ()
        return replace(self, entries=entries, remarks=(*self.remarks, *remark))

    def present(self, key: str) -> str:
        """Return the values of a column in words: the ends of numbers, the words that there are."""
        values = {getattr(e, key) for e in self.entries} - {None, ""}
        if not values:
            return f"no episode has a value of {key}"
        if key in WORDS:
            return f"{key} is {', '.join(sorted(values)[:MOST_NAMED])}"
        return f"{key} is {min(values):g} to {max(values):g} {UNITS.get(key, '')}".rstrip()

    def by(self, key: str) -> EpisodeList:
        """Return them sorted by a column; ``-key`` or an error sorts the greatest first, unknown values last.

        Raises:
            UsageError: If there is no such column.
        """
        name = key.lstrip("-")
        _known(name)
        # The worst episode is the one to look at.
        falling = key.startswith("-") or name == "error"
        # Unknown values compare with nothing, so they come last whichever way it is sorted.
        entries = [e for e in self.entries if getattr(e, name) is not None]
        unknown = tuple(e for e in self.entries if getattr(e, name) is None)
        ordered = sorted(entries, key=lambda e: getattr(e, name), reverse=falling)
        return replace(self, entries=(*ordered, *unknown))

    def numbered(self, number: int) -> Entry:
        """Return the episode of a number.

        Raises:
            UsageError: If there is none.
        """
        entry = next((e for e in self.entries if e.number == number), None)
        if entry is None:
            numbers = sorted(e.number for e in self.entries)
            allowed = f"{numbers[0]} to {numbers[-1]}" if numbers else "none is there"
            raise UsageError(f"episode {number}: not in {self.root}", allowed, "choose one of them")
        return entry


def with_flags(entries: tuple[Entry, ...], flags: dict[str, Flag]) -> tuple[Entry, ...]:
    """Return entries with the reasons why they are set aside, found by the recording's hash, else by its name."""
    by_file = {flag.file: flag.reason for flag in flags.values()}
    by_hash = {recording: flag.reason for recording, flag in flags.items()}
    return tuple(
        replace(e, flag=by_hash.get(e.recording, "" if e.recording else by_file.get(e.file, ""))) for e in entries
    )


def of_press(number: int, file: str, press: Press | None) -> Entry:
    """Return an entry with the nominal configuration."""
    if press is None:
        return Entry(number, file)
    return Entry(number, file, press.indenter_name, press.indenter.shape, press.x, press.y, press.depth, press.speed)


def with_notes(entries: tuple[Entry, ...], notes: Sequence[Note]) -> tuple[Entry, ...]:
    """Return entries with how many notes each has, found as flags are."""
    by_hash, by_file = Counter(note.recording for note in notes), Counter(note.file for note in notes)
    return tuple(replace(e, notes=(by_hash[e.recording] if e.recording else by_file[e.file]) or None) for e in entries)


@dataclass(frozen=True)
class Errors:
    """How far a prediction is from the label, over the frames that both hold."""

    error: float
    """Pixel root mean square error [mm]."""
    centroid: float | None
    """Mean distance of the centroids [px]; None where no frame has contact in both."""
    iou: float | None
    """Mean intersection over union [1]; None where no frame has contact in either."""


def errors_of(depth: np.ndarray, time_ns: np.ndarray, predicted: np.ndarray, predicted_ns: np.ndarray) -> Errors | None:
    """Return how far a prediction is off over the frames that both hold, or None where there are none.

    Args:
        depth: Labels [mm], shape (n, pixels_x, pixels_y).
        time_ns: Their times [ns], shape (n,).
        predicted: Predictions [mm], shape (m, pixels_x, pixels_y).
        predicted_ns: Their times [ns], shape (m,).
    """
    from tacdata.training.metrics.depth_maps import score_frames

    # By time: a network may have left out frames, and a label has its own.
    _, ours, theirs = np.intersect1d(time_ns, predicted_ns, return_indices=True)
    if not len(ours) or depth.shape[1:] != predicted.shape[1:]:
        return None
    scores = score_frames(predicted[theirs], depth[ours])
    return Errors(
        float(np.sqrt(np.mean(np.square(predicted[theirs] - depth[ours], dtype=np.float64)))),
        _mean(scores.centroid_error),
        _mean(scores.iou),
    )


def _mean(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None


def _parsed(condition: str) -> tuple[str, str, Any]:
    sign = next((s for s in OPERATORS if s in condition), None)
    if sign is None:
        raise UsageError(f"--where {condition}", "KEY OP VALUE with " + " ".join(OPERATORS), "for example depth>0.8")
    key, _, value = (part.strip() for part in condition.partition(sign))
    _known(key)
    if key in WORDS:
        return key, sign, value
    try:
        return key, sign, float(value)
    except ValueError:
        raise UsageError(f"--where {condition}: {value!r} is no number", f"a number for {key}", "correct it") from None


def _known(key: str) -> None:
    if key not in SHOWN:
        raise UsageError(f"no column {key!r}", ", ".join(SHOWN), "name one of them")
