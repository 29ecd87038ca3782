"""From a dataset folder to the trainer's flat arrays: the only place that knows both."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tacdata.dataset import Dataset, read_dataset
from tacdata.dataset.flags import flagged_episodes
from tacdata.dataset.format import features as key
from tacdata.dataset.reader import DatasetEpisode
from tacdata.paths import StrPath
from tacdata.training.frames.frames import EpisodeSpan, Frames

UNKNOWN = "unknown"
"""Indenter of an episode whose record an edit of the dataset lost."""


def read_frames(path: StrPath) -> Frames:
    """Read a dataset folder.

    Raises:
        UsageError: If there is no dataset.
        FormatError: If it is damaged, of several sensors, or holds values that are no numbers.
    """
    path = Path(path)
    return frames_of(read_dataset(path))


def frames_of(dataset: Dataset) -> Frames:
    """Return a dataset's frames; the arrays stay the dataset's own memory maps.

    Raises:
        FormatError: If it is of several sensors, or a column is damaged.
    """
    virtual = {episode.record.virtual for episode in dataset.episodes if episode.record}
    return Frames(
        taxels=dataset[key.STATE],
        depth=dataset[key.DEPTH],
        tip=dataset[key.TIP],
        phase=dataset[key.PHASE],
        time_ns=dataset[key.TIME],
        valid=_valid(dataset),
        episodes=tuple(_span(episode, dataset[key.TIP]) for episode in dataset.episodes),
        sensor=dataset.sensor,
        dataset_hash=dataset.content_hash,
        origin=str(dataset.root),
        virtual=(True in virtual) if virtual else None,
        simulated=dataset.simulated > 0,
        taxel_force=dataset[key.TAXEL_FORCE],
    )


def _valid(dataset: Dataset) -> np.ndarray:
    """Return which frames may be learned from and scored: none of an episode that a person has set aside."""
    valid, flagged = dataset[key.VALID], flagged_episodes(dataset)
    if flagged:
        # A copy: the dataset's own column must not change.
        valid = np.array(valid)
        for episode in dataset.episodes:
            if episode.index in flagged:
                valid[episode.start : episode.stop] = False
    return valid


def _span(episode: DatasetEpisode, tip: np.ndarray) -> EpisodeSpan:
    press, record = episode.press, episode.record
    specimen = (record.specimen or record.rig) if record else ""
    if press is None:
        path = tip[episode.start : episode.stop]
        x, y, depth = (float(v) for v in path[np.argmax(path[:, 2])])
        return EpisodeSpan(episode.index, episode.start, episode.stop, UNKNOWN, UNKNOWN, x, y, depth, None, specimen)
    return EpisodeSpan(
        episode.index,
        episode.start,
        episode.stop,
        press.indenter_name,
        press.indenter.shape,
        press.x,
        press.y,
        press.depth,
        press.speed,
        specimen,
        press.purpose,
    )
