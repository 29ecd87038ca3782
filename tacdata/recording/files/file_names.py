"""Names of recordings in a session folder."""

from __future__ import annotations

import re
from pathlib import Path

EPISODE = re.compile(r"episode-(\d{6})\.mcap")
PARTIAL = ".partial.mcap"


def episode(folder: Path, number: int) -> Path:
    """Return the path of a finished recording."""
    return folder / f"episode-{number:06d}.mcap"


def next_sync_tap(folder: Path) -> Path:
    """Return the first free name for the recording of a sync tap."""
    number = len({path.name.split(".")[0] for path in folder.glob("sync_tap-*.mcap")})
    return folder / f"sync_tap-{number:03d}.mcap"


def partial(path: Path) -> Path:
    """Return the name that a recording has while it is written."""
    return path.with_name(path.name.removesuffix(".mcap") + PARTIAL)


def next_interrupted(path: Path) -> Path:
    """Return the first free name for a recording of that press that was broken off."""
    stem = path.name.removesuffix(".mcap")
    names = {p.name for p in path.parent.glob(f"{stem}.interrupted-*.mcap")}
    number = next(k for k in range(len(names) + 1) if f"{stem}.interrupted-{k}.mcap" not in names)
    return path.with_name(f"{stem}.interrupted-{number}.mcap")


def finished(folder: Path) -> dict[int, Path]:
    """Return the finished recordings by their number, in order."""
    matches = ((EPISODE.fullmatch(path.name), path) for path in folder.iterdir())
    return dict(sorted((int(match.group(1)), path) for match, path in matches if match))


def unfinished(folder: Path) -> list[Path]:
    """Return the recordings that were broken off, by name."""
    return sorted([*folder.glob(f"episode-*{PARTIAL}"), *folder.glob("episode-*.interrupted-*.mcap")])
