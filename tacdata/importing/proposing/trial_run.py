"""A proposed mapping, tried on some of the files: its recordings in figures, and its faults."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tacdata.errors import TacdataError
from tacdata.importing.mapping import Mapping
from tacdata.importing.pressing.presses import Refusal, centre_of, presses_of
from tacdata.importing.pressing.trials import split_tables
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_files import FileSet, file_sets


@dataclass(frozen=True)
class TrialPolicy:
    """Limits of a mapping that is good. None was tuned on data."""

    sets: int = 5
    """Most sets of files that are tried [count]."""
    answer: float = 5.0
    """Smallest change of a channel that answers [its noise]."""
    zero: float = 0.5
    """Largest distance between the rests of files with one zero [median stroke]."""
    back: float = 0.5
    """Largest depth at the end of a whole press [its stroke]."""


POLICY = TrialPolicy()


@dataclass
class _Outcome:
    """Outcome of importing the sets of files."""

    presses: list[ImportedPress] = field(default_factory=list)
    rests: list[float] = field(default_factory=list)
    """Lowest depth of each set of files [mm]."""
    refusals: list[TacdataError] = field(default_factory=list)


def tried(source: Path, mapping: Mapping, policy: TrialPolicy = POLICY) -> str:
    """Return the outcome of importing some of the files by a mapping, or why nothing is imported, as a sentence.

    Args:
        source: The files.
        mapping: The mapping.
        policy: The limits of a good mapping.
    """
    try:
        sets = file_sets(source, mapping.files)
    except TacdataError as error:
        return f"as it stands, it imports nothing: {error.given}; {error.remedy}"
    samples = [sets[k] for k in sorted({round(k) for k in np.linspace(0, len(sets) - 1, policy.sets)})]
    outcome = _Outcome()
    for files in samples:
        _try_set(files, mapping, outcome)
    if not outcome.presses:
        error = outcome.refusals[0]
        return f"as it stands, it imports nothing: {error.given}; {error.remedy}"
    names = f"{len(samples)} of {len(sets)} sets of files hold" if len(sets) > 1 else "the source holds"
    sentence = f"tried: {names} {_figures(outcome.presses, policy)}"
    is_depth = mapping.position is None or mapping.position.depth_given
    remedy = "zero: lowest under depth" if is_depth else "zero: highest under z"
    faults = _faults(outcome, remedy, policy)
    return f"{sentence}\nnot good as it stands: {'; '.join(faults)}" if faults else sentence


def _try_set(files: FileSet, mapping: Mapping, outcome: _Outcome) -> None:
    """Import a set of files without writing it."""
    record = {"trial": "", "name": mapping.name}
    try:
        if files.fault:
            raise files.fault
        tables = files.tables()
        centre = centre_of(mapping.position, tables)
        parts = [
            part
            for label, rows in split_tables(tables, mapping)
            for part in presses_of(mapping, rows, files.parts, {**record, "trial": label}, centre)
        ]
    except TacdataError as error:
        outcome.refusals.append(error)
        return
    presses = [part for part in parts if isinstance(part, ImportedPress)]
    outcome.refusals += [part.error for part in parts if isinstance(part, Refusal)]
    outcome.presses += presses
    outcome.rests += [min(float(_depths(press).min()) for press in presses)] if presses else []


def _depths(press: ImportedPress) -> np.ndarray:
    """Return the depth at each row of the position [mm], shape (rows,)."""
    return press.registration["origin"][2] - press.position.values[:, 2]


def _figures(presses: list[ImportedPress], policy: TrialPolicy) -> str:
    depths = sorted(press.press.depth for press in presses)
    rows = sorted(len(press.taxels.time_ns) for press in presses)
    deep = " to ".join(dict.fromkeys(f"{depth:.3g}" for depth in (depths[0], depths[-1])))
    many = " to ".join(dict.fromkeys(str(number) for number in (rows[0], rows[-1])))
    width = presses[0].taxels.values.shape[1]
    answers = _answers(presses, policy)
    share = "" if answers is None else f", {answers} of them answer" if answers < width else ", all answer"
    return (
        f"{_counted(len(presses), 'recording')} of {many} rows at {_rate(presses):.3g} Hz, "
        f"{_counted(width, 'channel')}{share if width > 1 else ''}, pressed {deep} mm deep"
    )


def _rate(presses: list[ImportedPress]) -> float:
    """Return the median rate of the channels [Hz]; 0 if no time differs from the one before."""
    steps = np.concatenate([np.diff(press.taxels.time_ns) for press in presses])
    return 1e9 / float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def _answers(presses: list[ImportedPress], policy: TrialPolicy) -> int | None:
    """Return the number of channels that change by more than their noise in a press; None without a stroke."""
    changes = []
    for press in presses:
        depth = np.interp(press.taxels.time_ns, press.position.time_ns, _depths(press))
        stroke = float(np.ptp(depth))
        deep, shallow = depth >= depth.min() + 0.8 * stroke, depth <= depth.min() + 0.1 * stroke
        if stroke <= 0 or min(deep.sum(), shallow.sum()) < 3:
            continue
        readings = press.taxels.values
        noise = np.nanmedian(np.abs(np.diff(readings, axis=0)), axis=0)
        change = np.abs(np.nanmedian(readings[deep], axis=0) - np.nanmedian(readings[shallow], axis=0))
        changes.append(change > policy.answer * noise)
    return int(np.any(changes, axis=0).sum()) if changes else None


def _faults(outcome: _Outcome, own_zero: str, policy: TrialPolicy) -> list[str]:
    """Return the reasons for which a mapping is not good, with remedies; ``own_zero`` gives each file its zero."""
    presses = outcome.presses
    strokes = [float(np.ptp(_depths(press))) for press in presses]
    ends = [float(_depths(press)[-1] - _depths(press).min()) for press in presses]
    faults = []
    if outcome.refusals:
        number, error = len(outcome.refusals), outcome.refusals[0]
        faults.append(f"{_counted(number, 'part')} left out, first: {error.given} ({error.remedy})")
    if back := next((press.taxels.steps_back for press in presses if press.taxels.steps_back), ()):
        faults.append(f"time goes back {back[0]}: is another column the time, or does another one number the trials?")
    if not _rate(presses):
        faults.append("all rows of a recording have one time: name another column under time")
    if _answers(presses, policy) == 0:
        faults.append("no channel answers to any press: are other columns the channels, or another the position?")
    if max(press.press.depth for press in presses) <= 0 < max(strokes):
        faults.append("the position never reaches depth 0: correct its sign, or the zero by contact or offset")
    elif len(outcome.rests) > 1 and np.ptp(outcome.rests) > policy.zero * float(np.median(strokes)):
        faults.append(
            f"the highest positions of the files lie {np.ptp(outcome.rests):.3g} mm apart: if each file has its own "
            f"zero, count depth from it ({own_zero})"
        )
    cut = sum(end > policy.back * stroke > 0 for end, stroke in zip(ends, strokes, strict=True))
    if 2 * cut > len(presses) > 1:
        faults.append(
            f"{cut} of {len(presses)} recordings end deep in the skin: if ramp and hold are parts of one trial, join "
            "them (join: continued)"
        )
    return faults


def _counted(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"
