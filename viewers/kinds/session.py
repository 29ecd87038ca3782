"""A session folder."""

import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.recording.files import file_names
from tacdata.viewers.kinds.kind import Kind
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

EARLIER = 1_000_000_000
"""By how much the first frame may have been sampled before its arrival [ns]."""


class SessionKind(Kind):
    """An episode of a folder that `tacdata record` wrote."""

    ORDER, NOUN = 90, "a session folder"

    def claims(self, path: Path) -> bool:
        """Any folder: missing files are reported when it is opened."""
        return path.is_dir()

    def holds(self, path: Path) -> bool:
        """A folder with a recording in it."""
        return bool(file_names.finished(path) or file_names.unfinished(path))

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return one episode; if none is named the first, or the first that the predictions are of."""
        from tacdata.viewers.parts.prediction_files import first_predicted
        from tacdata.viewers.scenes.recording import recording_scene

        number = options.episode
        if number is None and options.predictions is not None:
            number = first_predicted(options.predictions, spans(path))
        return recording_scene(episode_of(path, number), options)


def spans(folder: Path) -> Iterator[tuple[int, int, int]]:
    """Yield number, first and last time [ns] of each finished recording, from its summary."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader

    for number, path in file_names.finished(folder).items():
        with path.open("rb") as stream, suppress(McapError, ValueError, struct.error):
            summary = SeekingReader(stream).get_summary()
            if summary is not None and summary.statistics is not None:
                span = summary.statistics
                yield number, span.message_start_time - EARLIER, span.message_end_time


def episode_of(folder: Path, episode: int | None) -> Path:
    """Return the recording of an episode, the first finished one if none is named; else one that is unfinished.

    Raises:
        UsageError: If there is none, or none of that number.
    """
    finished, begun = file_names.finished(folder), file_names.unfinished(folder)
    # A recording in progress can be followed from its first frame on.
    if not finished and begun and episode is None:
        return begun[0]
    if not finished:
        raise UsageError(
            f"{folder} holds no finished recording",
            "a folder that tacdata record, pack, track, export, discrepancy or revise wrote",
            f"view one that was broken off, or is being written: {begun[0]}" if begun else "check the path",
        )
    if episode is None:
        return next(iter(finished.values()))
    if episode not in finished:
        numbers = sorted(finished)
        allowed = ", ".join(map(str, numbers)) if len(numbers) <= 20 else f"{numbers[0]} to {numbers[-1]}"
        raise UsageError(f"--episode {episode}: not in {folder}", allowed, "choose one of them")
    return finished[episode]
