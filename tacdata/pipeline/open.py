"""Opens any path as its kind of object."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tacdata.dataset.reader import Dataset, read_dataset
from tacdata.errors import UsageError
from tacdata.labels import Label, read_label
from tacdata.paths import StrPath
from tacdata.recording import Episode, Session, read_episode, read_session
from tacdata.recording.session import FILE

if TYPE_CHECKING:
    from tacdata.discrepancy.verdict_folder import VerdictFolder
    from tacdata.pipeline.trained_network import TrainedNetwork

ALLOWED = (
    "a session, dataset, verdict or network folder, a .mcap recording, a .parquet label or a .safetensors checkpoint"
)


def open(path: StrPath) -> Session | Episode | Label | Dataset | TrainedNetwork | VerdictFolder:
    """Open a path as its kind of object: a session, an episode, a label, a dataset, a network or a verdict.

    Raises:
        UsageError: If there is nothing, or nothing of these kinds.
        FormatError: If it is damaged.

    Example:
        >>> import tacdata as td
        >>> td.open("session/episode-000000.mcap").number
        0
        >>> td.open("session").folder.name
        'session'
    """
    place = Path(path)
    if place.suffix == ".mcap":
        return read_episode(place)
    if place.suffix == ".parquet":
        return read_label(place)
    if (place / FILE).is_file():
        return read_session(place)
    if (place / "meta" / "info.json").is_file():
        return read_dataset(place)
    if place.name == "verdict.json" or (place / "verdict.json").is_file():
        from tacdata.discrepancy.verdict_folder import read_verdict

        return read_verdict(place)
    if place.suffix == ".safetensors" or (place / "best.safetensors").is_file():
        from tacdata.pipeline.trained_network import read_network

        return read_network(place)
    problem = f"{path} is no session, dataset, verdict or network" if place.exists() else f"no file or folder {path}"
    raise UsageError(problem, ALLOWED, "check the path")
