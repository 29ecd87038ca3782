"""A proposed mapping, tried on some of the files: its recordings in figures, and its faults."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.errors import TacdataError
from tacdata.importing.mapping import Mapping
from tacdata.importing.pressing.presses import Refusal, centre_of, presses_of
from tacdata.importing.pressing.trials import split_tables
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_files import FileSet, file_sets
from tacdata.importing.source_table import SourceTable


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


@dataclass(frozen=True)
class TrialRun:
    """The result of trying a mapping on some sets of files."""

    mapping: Mapping
    by_set: tuple[tuple[FileSet, tuple[ImportedPress, ...]], ...] = ()
    """Each set of files that was tried, and its recordings."""
    refusals: tuple[TacdataError, ...] = ()
    """Why sets, or parts of them, give none."""
    sets: int = 0
    """Sets of files that the mapping finds."""
    policy: TrialPolicy = POLICY

    @property
    def presses(self) -> tuple[ImportedPress, ...]:
        """All recordings."""
        return tuple(press for _, presses in self.by_set for press in presses)

    @property
    def rests(self) -> list[float]:
        """Lowest depth of each set of files with a recording [mm]."""
        return [min(float(_depths(press).min()) for press in presses) for _, presses in self.by_set if presses]

    @property
    def sentence(self) -> str:
        """The recordings in figures, or why there are none."""
        if not self.presses:
            return f"as it stands, it imports nothing: {self.refusals[0].given}; {self.refusals[0].remedy}"
        tried = len(self.by_set)
        names = f"{tried} of {self.sets} sets of files hold" if self.sets > 1 else "the source holds"
        return f"tried: {names} {_figures(self.presses, self.policy)}"

    @property
    def faults(self) -> tuple[str, ...]:
        """Reasons for which the mapping is not good, with remedies."""
        return tuple(_faults(self)) if self.presses else ()


def tried(source: Path, mapping: Mapping) -> str:
    """Return the outcome of importing some of the files by a mapping, or why nothing is imported, as a sentence."""
    run = trial_run(source, mapping)
    return f"{run.sentence}\nnot good as it stands: {'; '.join(run.faults)}" if run.faults else run.sentence


def trial_run(
    source: Path,
    mapping: Mapping,
    policy: TrialPolicy = POLICY,
    tables_of: Callable[[FileSet], dict[str, SourceTable]] = FileSet.tables,
) -> TrialRun:
    """Import some of the files by a mapping, without writing them.

    Args:
        source: The files.
        mapping: The mapping.
        policy: The limits of a good mapping.
        tables_of: Reads a set of files.
    """
    try:
        sets = file_sets(source, mapping.files)
    except TacdataError as error:
        return TrialRun(mapping, refusals=(error,), policy=policy)
    by_set, refusals = [], list[TacdataError]()
    # Spread over the whole source: neighbouring files resemble each other.
    for files in [sets[k] for k in sorted({round(k) for k in np.linspace(0, len(sets) - 1, policy.sets)})]:
        parts: list[ImportedPress | Refusal] = []
        try:
            parts = _parts(files, mapping, tables_of)
        except TacdataError as error:
            refusals.append(error)
        by_set.append((files, tuple(part for part in parts if isinstance(part, ImportedPress))))
        refusals += [part.error for part in parts if isinstance(part, Refusal)]
    return TrialRun(mapping, tuple(by_set), tuple(refusals), len(sets), policy)


def _parts(
    files: FileSet, mapping: Mapping, tables_of: Callable[[FileSet], dict[str, SourceTable]]
) -> list[ImportedPress | Refusal]:
    """Return the recordings of a set of files, and the refusals of its parts."""
    if files.fault:
        raise files.fault
    tables, record = tables_of(files), {"name": mapping.name}
    centre = centre_of(mapping.position, tables)
    return [
        part
        for label, rows in split_tables(tables, mapping)
        for part in presses_of(mapping, rows, files.parts, {**record, "trial": label}, centre)
    ]


def _depths(press: ImportedPress) -> np.ndarray:
    """Return the depth at each row of the position [mm], shape (rows,)."""
    return press.registration["origin"][2] - press.position.values[:, 2]


def _figures(presses: Sequence[ImportedPress], policy: TrialPolicy) -> str:
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


def _rate(presses: Sequence[ImportedPress]) -> float:
    """Return the median rate of the channels [Hz]; 0 if no time differs from the one before."""
    steps = np.concatenate([np.diff(press.taxels.time_ns) for press in presses])
    return 1e9 / float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def _answers(presses: Sequence[ImportedPress], policy: TrialPolicy) -> int | None:
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


def _faults(run: TrialRun) -> list[str]:
    presses, rests, position, policy = run.presses, run.rests, run.mapping.position, run.policy
    own_zero = "zero: lowest under depth" if position is None or position.depth_given else "zero: highest under z"
    strokes = [float(np.ptp(_depths(press))) for press in presses]
    ends = [float(_depths(press)[-1] - _depths(press).min()) for press in presses]
    faults = []
    if run.refusals:
        number, error = len(run.refusals), run.refusals[0]
        faults.append(f"{_counted(number, 'part')} left out, first: {error.given} ({error.remedy})")
    if back := next((press.taxels.steps_back for press in presses if press.taxels.steps_back), ()):
        faults.append(f"time goes back {back[0]}: is another column the time, or does another one number the trials?")
    if not _rate(presses):
        faults.append("all rows of a recording have one time: name another column under time")
    if _answers(presses, policy) == 0:
        faults.append("no channel answers to any press: are other columns the channels, or another the position?")
    if position is not None and position.columns and not max(strokes):
        faults.append("the position never moves: is another column or file the position?")
    if max(press.press.depth for press in presses) <= 0 < max(strokes):
        faults.append("the position never reaches depth 0: correct its sign, or the zero by contact or offset")
    elif len(rests) > 1 and np.ptp(rests) > policy.zero * float(np.median(strokes)):
        faults.append(
            f"the highest positions of the files lie {np.ptp(rests):.3g} mm apart: if each file has its own "
            f"zero, count depth from it ({own_zero})"
        )
    cut = sum(end > policy.back * stroke > 0 for end, stroke in zip(ends, strokes, strict=True))
    if 2 * cut > len(presses) > 1 and not any(entry.join for entry in run.mapping.files.values()):
        faults.append(
            f"{cut} of {len(presses)} recordings end deep in the skin: if ramp and hold are parts of one trial, join "
            "them (join: continued)"
        )
    return faults


def _counted(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"
