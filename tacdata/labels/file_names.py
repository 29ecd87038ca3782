"""Names of label files: one file an episode, or the reason why there is none, all in the session's folder."""

from __future__ import annotations

import re
from pathlib import Path

LABEL, FAILURE = ".parquet", ".failure.json"
"""Endings of a label and of the reason why an episode has none."""
EPISODE = re.compile(r"episode-(\d{6})(\..+)")


def folder(session: Path) -> Path:
    """Return the folder of a session's labels."""
    return session / "labels"


def store(labels: Path) -> Path:
    """Return the default folder of the solved presses of these labels."""
    return labels / "store"


def label(labels: Path, episode: int | Path) -> Path:
    """Return the path of an episode's label; the episode is given by its number or recording."""
    return labels / f"{_stem(episode)}{LABEL}"


def failure(labels: Path, episode: int | Path) -> Path:
    """Return the path of the reason why an episode has no label."""
    return labels / f"{_stem(episode)}{FAILURE}"


def present(labels: Path, ending: str = LABEL) -> dict[int, Path]:
    """Return the files of an ending that lie there, by the number of their episode, in order."""
    matches = ((EPISODE.fullmatch(path.name), path) for path in labels.glob(f"episode-*{ending}"))
    return dict(sorted((int(match[1]), path) for match, path in matches if match and match[2] == ending))


def _stem(episode: int | Path) -> str:
    return f"episode-{episode:06d}" if isinstance(episode, int) else episode.stem
