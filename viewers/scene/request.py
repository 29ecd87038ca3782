"""The options of a person who wants to see a path."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


def nothing() -> None:
    """Do nothing meanwhile."""


@dataclass(frozen=True)
class Asked:
    """Options in addition to the path: labels, predictions, episode."""

    labels: Path | None = None
    """Folder of labels."""
    predictions: Path | None = None
    """Folder of predictions, or a training run."""
    episode: int | None = None
    """Number of the episode in a folder."""
    meanwhile: Callable[[], None] = nothing
    """Work to do while a large file is read: imports, mostly."""
