"""The content of a split's file.

A file ``training/splits/my_split.py`` defines one function,
``held_out(episodes, sensor, generator) -> set[int]``, that returns the numbers of the test episodes. Whole
episodes only: frames of one press are so similar that dividing them would score memory. The file's docstring
states the question of the split; `divide` draws the validation episodes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.training.frames.frames import Frames

ROOM, BASE = "tacdata.training.splits", "split"
TEST_SHARE = 0.15
VALIDATION_SHARE = 0.15


@dataclass(frozen=True)
class Split:
    """The episodes of training, validation and test."""

    name: str
    """File name in training/splits."""
    seed: int
    """Seed of every draw."""
    train: tuple[int, ...]
    """Numbers of the training episodes."""
    validation: tuple[int, ...]
    """Numbers of the validation episodes: they choose the best epoch, nothing else."""
    test: tuple[int, ...]
    """Numbers of the test episodes."""

    @property
    def document(self) -> dict[str, Any]:
        """The split as plain data (JSON types)."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Split:
        """Rebuild a split from `document`."""
        return cls(document["name"], document["seed"], *(tuple(document[k]) for k in ("train", "validation", "test")))


def describe(name: str) -> str:
    """Return the question of a split: the first line of its file.

    Raises:
        UsageError: If no such split exists.
    """
    return (registry.load_module(ROOM, BASE, name).__doc__ or "").splitlines()[0]


def divide(frames: Frames, name: str, seed: int) -> Split:
    """Divide a dataset by whole episodes.

    Raises:
        UsageError: If no such split exists, or one of the three parts would be empty.
    """
    rule = registry.load_module(ROOM, BASE, name)
    generator = np.random.default_rng(seed)
    test = rule.held_out(frames.episodes, frames.sensor, generator)
    training = [e.number for e in frames.episodes if e.number not in test]
    count = share(len(frames.episodes), VALIDATION_SHARE)
    # Whole episodes: neighbouring frames are nearly the same, and would leak between the parts.
    validation = set(generator.permutation(training)[:count].tolist()) if len(training) > 1 else set()
    train = tuple(n for n in training if n not in validation)
    split = Split(name, seed, train, tuple(sorted(validation)), tuple(sorted(test)))
    for part in ("train", "validation", "test"):
        if not getattr(split, part):
            raise UsageError(
                f"split {name!r} of the {len(frames.episodes)} episodes in {frames.origin} leaves no {part} episode",
                "at least one episode each for train, validation and test",
                "record more episodes, or choose another --split",
            )
    return split


def share(total: int, fraction: float) -> int:
    """Return ``fraction`` of ``total``, rounded, and at least 1."""
    return max(1, round(total * fraction))
