"""Tip error before and after, against a second observation or a known truth."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.discrepancy.data.tip_observation import NEAR_NS, second_views
from tacdata.effects import Placed
from tacdata.errors import FormatError, UsageError
from tacdata.recording import Episode, read_episode, read_session
from tacdata.revision.labels.pose_path import moved_episodes

COLUMNS = ("time_ns", "x", "y", "depth")
"""Columns of a file with the tip's true path: the recording's time [ns], then mm in the sensor's frame."""
FEWEST = 5
"""Minimum number of points of an episode in contact."""
BETTER = 0.9
"""Factor of the error by which an episode counts as better or worse [1]."""


@dataclass(frozen=True)
class TipError:
    """Distance of the labels' tip positions from the true ones."""

    against: str
    """Reference: a file's name, or "tag"."""
    episodes: int
    """Episodes that could be compared."""
    before: float
    """Root mean square error of the commanded path in contact, without the session's constant part [mm]."""
    after: float
    """The same with the model's effects [mm]."""
    most_before: float
    """Largest distance [mm]."""
    most_after: float
    """The same with the effects [mm]."""
    better: int
    """Episodes whose error became smaller."""
    worse: int
    """Episodes whose error became larger."""
    constant_before: float
    """Constant part of the error [mm], mostly an error of the registration; 0 against a tag, which cannot show it."""
    constant_after: float
    """The same with the effects [mm]."""


def tip_error(session: Path, placed: Sequence[Placed], truth: Path | None = None) -> TipError | None:
    """Return the tip error before and after, or None where there is no reference.

    Each session's median is subtracted from both, because the registration has a constant error too; it is reported
    separately. A tag does not see parts that bend behind it, so only effects that it can see are compared with it.

    Args:
        session: Folder of recordings.
        placed: Effects of the model.
        truth: File of the tip's true path, as `COLUMNS`; None for the recordings' own second observation.
    """
    old = [read_episode(path) for path in read_session(session).episodes]
    if truth is not None:
        views, effects = _true_views(truth, old), [p for p in placed if p.stage == "kinematics"]
    else:
        views = {k: (view.time_ns, view.tip) for k, view in second_views(old).items()}
        # Parts that give way below the tag are not seen by it.
        effects = [p for p in placed if p.stage == "kinematics" and p.seen_by_tag]
    if not effects:
        return None
    new = {e.number: e for e in moved_episodes(old, effects)}
    errors = [_apart(old[k], new[old[k].number], *view) for k, view in sorted(views.items())]
    # A few points in contact give no root mean square.
    errors = [pair for pair in errors if len(pair[0]) >= FEWEST]
    if not errors:
        return None
    # The registration has a constant error of its own, which is reported apart from the path's.
    constants = [np.nanmedian(np.concatenate([pair[i] for pair in errors]), axis=0) for i in (0, 1)]
    errors = [(a - constants[0], b - constants[1]) for a, b in errors]
    constant = [0.0 if truth is None else float(np.sqrt(np.nansum(np.square(w)))) for w in constants]
    far = [[np.sqrt(np.nansum(np.square(way), axis=1)) for way in pair] for pair in errors]
    each = np.array([[np.sqrt(np.mean(way**2)) for way in pair] for pair in far])
    first, last = (np.concatenate([pair[i] for pair in far]) for i in (0, 1))
    return TipError(
        "tag" if truth is None else truth.name,
        len(far),
        float(np.sqrt(np.mean(first**2))),
        float(np.sqrt(np.mean(last**2))),
        float(first.max()),
        float(last.max()),
        int((each[:, 1] < BETTER * each[:, 0]).sum()),
        int((BETTER * each[:, 1] > each[:, 0]).sum()),
        *constant,
    )


def _apart(original: Episode, update: Episode, time_ns: np.ndarray, view: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the tip error before and after while it touches [mm], each of shape (n, 3)."""
    nominal, revised = original.tip_at(time_ns), update.tip_at(time_ns)
    good = (nominal[:, 2] > 0) & np.isfinite(view[:, 2])
    # Beyond its ends the path would be extrapolated.
    good &= (time_ns >= original.tip_ns[0] - NEAR_NS) & (time_ns <= original.tip_ns[-1] + NEAR_NS)
    return view[good] - nominal[good], view[good] - revised[good]


def _true_views(path: Path, episodes: Sequence[Episode]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    time, tip = _read(path)
    views = {}
    for k, episode in enumerate(episodes):
        if len(episode.tip_ns):
            rows = slice(*np.searchsorted(time, [episode.tip_ns[0], episode.tip_ns[-1] + 1]))
            if len(time[rows]) >= FEWEST:
                views[k] = time[rows], tip[rows]
    if not views:
        raise UsageError(
            f"{path} covers none of the recordings' times",
            "the recordings' own clock, in ns",
            "check its column time_ns",
        )
    return views


def _read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file():
        raise UsageError(f"no file {path}", f"a CSV file of {', '.join(COLUMNS)}", "check --truth")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    try:
        time = np.array([int(row["time_ns"]) for row in rows], dtype=np.int64)
        tip = np.array([[float(row[name]) for name in COLUMNS[1:]] for row in rows])
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{path}: {error}", f"numbers in columns {', '.join(COLUMNS)}", "correct it") from None
    if not len(time):
        raise FormatError(f"{path} is empty", f"rows of {', '.join(COLUMNS)}", "give another --truth")
    order = np.argsort(time, kind="stable")
    return time[order], tip[order]
