"""Makes the scene of a path of any kind."""

from collections.abc import Callable
from pathlib import Path

from tacdata.viewers.kinds.kind import kind_of
from tacdata.viewers.scene.request import Asked, nothing
from tacdata.viewers.scene.scene import Scene


def scene_at(
    path: Path,
    labels: Path | None = None,
    predictions: Path | None = None,
    episode: int | None = None,
    meanwhile: Callable[[], None] = nothing,
) -> Scene:
    """Return the scene of a path.

    Args:
        path: A recording, session, dataset, demonstration, folder of targets, verdict or revision (`viewers.kinds`).
        labels: Folder of labels; without it ``labels`` in the folder of the recording, if there is one.
        predictions: Folder of predictions, or a training run.
        episode: Its number in the folder; without it the first.
        meanwhile: Work to do while a large file is read.

    Raises:
        UsageError: If there is nothing to view, or a named folder holds nothing.
        FormatError: If a file is damaged or of another sensor.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.viewers.source import scene_at
        >>> scene = scene_at(Path("session/episode-000000.mcap"))
        >>> [phase.name for phase in scene.phases][:3]
        ['rest', 'approach', 'press']
    """
    return kind_of(path).scene(path, Asked(labels, predictions, episode, meanwhile))
