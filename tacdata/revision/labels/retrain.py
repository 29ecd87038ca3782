"""Trains a network on data before and after a revision, and compares their scores."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata.dataset.pack import LabelFiles, pack
from tacdata.effects import Placed
from tacdata.errors import UsageError
from tacdata.labels import Label, file_names
from tacdata.recording import Episode, read_episode, read_session
from tacdata.revision.comparison import Comparison
from tacdata.revision.labels.pose_path import moved_episodes

if TYPE_CHECKING:
    from tacdata.training.frames.frames import Frames

FEWEST = 5
"""Minimum number of episodes with labels: for training, for early stopping, for scoring."""
LABELS, READINGS = "labels", "readings"
"""Part of the training data that the revision changes: labels or readings."""


@dataclass(frozen=True)
class Recipe:
    """How both networks are trained."""

    epochs: int = 10
    network: str = "paper"
    seed: int = 0
    threads: int | None = None


@dataclass(frozen=True)
class Retrained:
    """Two networks that differ in the model alone."""

    by: str
    """`LABELS`: both networks learn from measured readings, with labels of either model. `READINGS`: both learn from
    readings that either model predicts, with the same labels, and are scored on measured ones.
    """
    episodes: int
    """Scored episodes, which neither network saw."""
    frames: int
    """Scored frames in contact."""
    epochs: int
    metrics: tuple[dict[str, Any], ...]
    """Name, title, unit, before, after; None where undefined."""


def retrained(
    sessions: Sequence[Path],
    labels: dict[Path, Path],
    comparison: Comparison,
    placed: Sequence[Placed],
    folder: Path,
    recipe: Recipe,
    note: Callable[[str], None] = lambda text: None,
) -> Retrained:
    """Pack, train and score twice.

    Args:
        sessions: Folders of recordings, in the order of the verdict.
        labels: Session -> folder of its labels under the revised model; without entries labels are kept.
        comparison: Recordings and the model before.
        placed: The effects that were added.
        folder: Folder of both datasets and networks.
        recipe: How to train.
        note: Called with a line of progress.

    Raises:
        UsageError: If too few episodes have labels.
    """
    by = LABELS if labels else READINGS
    sides = _sides(sessions, labels, placed)
    measured = sides["before"]
    if len(measured) < FEWEST:
        raise UsageError(
            f"{len(measured)} episodes with a label",
            f"{FEWEST} or more, to train on and to score",
            "run `tacdata label SESSION` first",
        )
    note("datasets of both models")
    if by == READINGS:
        simulated = _Simulated(comparison)
        for side, effects in (("before", []), ("after", placed)):
            sides[side] = [
                (replace(e, taxels=replace(e.taxels, counts=simulated(e, effects))), label) for e, label in sides[side]
            ]
    frames = {side: _frames(folder / side, examples) for side, examples in sides.items()}
    # One truth for both networks, or their scores would differ by the labels alone.
    judge = frames["after"] if by == LABELS else _frames(folder / "measured", measured)
    scores = [
        _scored(frames[side], judge, folder / f"network-{side}", recipe, lambda t, s=side: note(f"{s}: {t}"))
        for side in ("before", "after")
    ]
    return _outcome(by, recipe, *scores)


Examples = list[tuple[Episode, Label]]


def _sides(sessions: Sequence[Path], labels: dict[Path, Path], placed: Sequence[Placed]) -> dict[str, Examples]:
    """Return the recordings with their labels under either model, those that both label."""
    sides: dict[str, Examples] = {"before": [], "after": []}
    for session in sessions:
        if not file_names.folder(session).is_dir():
            raise UsageError(f"{session} has no labels", "a labelled session", f"run `tacdata label {session}` first")
        episodes = [read_episode(path) for path in read_session(session).episodes]
        old = LabelFiles(file_names.folder(session))
        new, revised = old, {e.path: e for e in episodes}
        if session in labels:
            new, revised = LabelFiles(labels[session]), {e.path: e for e in moved_episodes(episodes, placed)}
        for episode in episodes:
            before, after = old(episode), new(episode)
            if before is not None and after is not None:
                sides["before"].append((episode, before))
                sides["after"].append((revised[episode.path], after))
    return sides


class _Simulated:
    """A model's predicted readings of a recording, with noise like the recording's."""

    def __init__(self, comparison: Comparison) -> None:
        self._held = comparison
        self._predicted: dict[int, np.ndarray] = {}
        self._names = list(comparison.course.names)

    def __call__(self, episode: Episode, placed: Sequence[Placed]) -> np.ndarray:
        course, key = self._held.course, id(placed)
        if key not in self._predicted:
            model = self._held.after(placed) if placed else self._held.before
            self._predicted[key] = self._held.predicted(model.response, list(model.placed))
        counts = episode.taxels.counts.astype(float).copy()
        seconds = (episode.taxels.sample_ns - episode.taxels.sample_ns[0]) * 1e-9
        # By the recording's name: both sides get the same noise, so the models alone differ.
        rng = np.random.default_rng(int.from_bytes(hashlib.sha256(episode.path.name.encode()).digest()[:8]))
        k = self._names.index(episode.path.stem)
        rows = np.flatnonzero(course.episode == k)
        read = rows[course.averaged[rows] > 0]
        when = course.time[rows] - course.time[read[0]]
        # The model predicts changes; a recording has a level of its own.
        level = np.nanmedian(course.readings[read] - self._predicted[key][read], axis=0)
        noise = self._held.null.noise.scale
        for c, number in enumerate(course.numbers or range(course.channels)):
            simulated = np.interp(seconds, when, self._predicted[key][rows, c]) + level[c]
            counts[:, number] = simulated + noise[c] * rng.normal(size=len(seconds))
        return counts


def _frames(folder: Path, examples: Examples) -> Frames:
    from tacdata.training.frames.data import read_frames

    labels = {episode.path: label for episode, label in examples}
    pack([episode for episode, _ in examples], lambda episode: labels[episode.path], folder)
    return read_frames(folder)


def _scored(frames: Frames, judge: Frames, folder: Path, recipe: Recipe, note: Callable[[str], None]) -> dict[str, Any]:
    """Return the scores of a network on the episodes of another dataset that are its own test episodes."""
    from tacdata.training.scoring.evaluate import evaluate
    from tacdata.training.settings import TrainingSettings
    from tacdata.training.train import train

    settings = TrainingSettings(network=recipe.network, epochs=recipe.epochs, seed=recipe.seed)

    def note_epoch(progress: Any) -> None:
        if progress.finished is not None:
            note(f"epoch {progress.epoch} of {progress.epochs}")

    trained = train(frames, settings, folder, "auto", False, recipe.threads, note_epoch)
    return evaluate(trained, _part(judge, trained.split.test), "auto", recipe.threads).document


def _part(frames: Frames, numbers: tuple[int, ...]) -> Frames:
    """Return a dataset of some episodes, marked as another one than the training data."""
    spans, rows, at = [], [], 0
    for span in frames.spans(numbers):
        indices = np.arange(span.start, span.stop)
        rows.append(indices)
        spans.append(replace(span, start=at, stop=at + len(indices)))
        at += len(indices)
    index = np.concatenate(rows)
    names = ("taxels", "depth", "tip", "phase", "time_ns", "valid")
    # A part of a dataset is another dataset: scores on it must not pass for those of the whole.
    digest = hashlib.sha256(f"{frames.dataset_hash} {sorted(numbers)}".encode()).hexdigest()
    values = {name: np.asarray(getattr(frames, name))[index] for name in names}
    return replace(frames, **values, episodes=tuple(spans), dataset_hash=digest)


def _outcome(by: str, recipe: Recipe, initial: dict[str, Any], final: dict[str, Any]) -> Retrained:
    from tacdata.training.scoring.evaluate import METRICS

    pair = initial, final
    rows = [
        (name, f"{METRICS[name][1]}, frames in contact", METRICS[name][2], [d["contact_frames"][name] for d in pair])
        for name in METRICS
    ]
    for name, title in (("centre_depth", "Depth at the contact's centre"), ("position", "Place of the contact")):
        scores = [d["prescribed"]["prediction"][name] for d in pair]
        rows.append((name, f"{title}, off the pose, at full depth", "mm", scores))
    metrics = tuple(
        {"name": name, "title": title, "unit": unit, "before": before["mean"], "after": after["mean"]}
        for name, title, unit, (before, after) in rows
    )
    frames = final["frames"]["in_contact"]
    return Retrained(by, len(final["split"]["episodes"]), frames, recipe.epochs, metrics)
