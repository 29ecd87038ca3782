"""Makes labels again under a revised model, in a new folder: only those that its effects change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tacdata.effects import Placed
from tacdata.label_farm.labelling import FarmSettings, Labelling, LabellingSummary
from tacdata.label_farm.store.store import Store
from tacdata.labels import file_names, read_label
from tacdata.recording import read_episode, read_session
from tacdata.revision.labels.pose_path import moved_episodes
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Moved:
    """How a revised model changes labels."""

    episodes: int
    """Episodes with contact."""
    paths: int
    """Episodes whose tip moves by more than `LEAST`."""
    path_rms: float
    """Shift of the tip, root mean square in contact [mm]."""
    path_most: float
    """Largest shift of the tip [mm]."""
    labels: int = 0
    """Labels compared with the old ones."""
    rms: float = float("nan")
    """Root mean square change of depth over pixels dented in either [mm]; NaN if none was compared."""
    most: float = float("nan")
    """Largest change of a pixel [mm]."""
    solved: int = 0
    """Paths that were solved."""
    found: int = 0
    """Paths that were found in the store."""
    failed: dict[int, str] = field(default_factory=dict)
    """Episode -> why it has no new label."""


LEAST = 0.001
"""Shift of the tip below which a label is kept [mm]."""


def moves_labels(placed: Sequence[Placed]) -> bool:
    """Return whether effects change labels: the tip's path, its timing, or the skin's thickness."""
    return any(p.stage == "kinematics" or p.effect.changes_skin or p.effect.delay(p.values) != 0 for p in placed)


def paths_moved(session: Path, placed: Sequence[Placed]) -> Moved:
    """Return how a model's effects shift the tip in a session, without making labels."""
    old = [read_episode(path) for path in read_session(session).episodes]
    new = {e.number: e for e in moved_episodes(old, placed)}
    squares, largest, paths, touching = [], 0.0, 0, 0
    for episode in old:
        inside = episode.tip[:, 2] > 0
        if not inside.any():
            continue
        touching += 1
        counterpart = new[episode.number]
        nominal = episode.tip_at(counterpart.tip_ns)
        way = np.linalg.norm(counterpart.tip - nominal, axis=1)[(nominal[:, 2] > 0) | (counterpart.tip[:, 2] > 0)]
        # Each episode counts once, however finely its path is divided.
        squares.append(np.mean(way**2))
        largest = max(largest, float(way.max()))
        paths += bool(way.max() > LEAST)
    return Moved(touching, paths, float(np.sqrt(np.mean(squares))) if squares else 0.0, largest)


def relabelled(
    session: Path,
    placed: Sequence[Placed],
    folder: Path,
    settings: FarmSettings,
    store: Path | None = None,
    progress: Callable[[str, int, int], None] = lambda *_: None,
) -> Moved:
    """Make a session's labels under a revised model, in a folder of their own, and compare them with the old ones.

    A path whose place, depths and model are the same is found in the store and not solved again.

    Args:
        session: The session's folder.
        placed: The model's effects.
        folder: Folder of the new labels; the session's own are kept.
        settings: How to label; the same as for the old labels, or all of them are new.
        store: Store of solved paths; by default the session's own.
        progress: Called with the progress.
    """
    recorded = read_session(session)
    episodes = {e.number: e for e in moved_episodes([read_episode(p) for p in recorded.episodes], placed)}
    skin = changed_skin(recorded.sensor, placed)
    labelling = Labelling(folder, Store(store or file_names.store(file_names.folder(session))), settings, progress)
    readers = {number: (lambda e=episode: e) for number, episode in episodes.items()}
    summary = labelling.run(readers, skin)
    return _compared(paths_moved(session, placed), file_names.folder(session), folder, summary)


def changed_skin(sensor: Sensor, placed: Sequence[Placed]) -> Sensor | None:
    """Return the sensor with the thickness that effects give it; None if they do not change it."""
    factor = float(np.prod([p.effect.thickness_factor(p.values) for p in placed]))
    if factor == 1.0:
        return None
    return replace(sensor, skin=replace(sensor.skin, thickness=sensor.skin.thickness * factor))


def _compared(shift: Moved, old_folder: Path, new_folder: Path, summary: LabellingSummary) -> Moved:
    squares, count, largest, labels = 0.0, 0, 0.0, 0
    for path in file_names.present(new_folder).values():
        if not (old_folder / path.name).is_file():
            continue
        old, new = read_label(old_folder / path.name), read_label(path)
        # Labels of other frames have no pixels to compare.
        if old.depth.shape != new.depth.shape:
            continue
        labels += 1
        dented = old.dented | new.dented
        change = (new.depth - old.depth)[dented]
        squares, count = squares + float(np.square(change, dtype=float).sum()), count + int(dented.sum())
        largest = max(largest, float(np.abs(change).max(initial=0.0)))
    return replace(
        shift,
        labels=labels,
        rms=float(np.sqrt(squares / count)) if count else (0.0 if labels else float("nan")),
        most=largest if labels else float("nan"),
        solved=len(summary.seconds),
        found=summary.found,
        failed=dict(summary.failed),
    )
