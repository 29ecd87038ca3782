"""A demonstration by hand: its recording, its tracks, or the folder of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tacdata.errors import TacdataError
from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

if TYPE_CHECKING:
    from tacdata.demonstrations.recording.reader import DemoRecording

HEAD = 1 << 20
"""Bytes at a recording's beginning in which its attachments are looked for."""


class DemonstrationKind(Kind):
    """A demonstration that `tacdata record --demo` recorded and `tacdata track` worked up."""

    ORDER, NOUN = 20, "a demonstration or its tracks"

    def claims(self, path: Path) -> bool:
        """A folder of demonstrations, a tracks file, or a recording with a demo rig."""
        from tacdata.demonstrations.paths.tracks_file import ENDING
        from tacdata.demonstrations.recording.session import FILE

        if path.is_dir():
            return (path / FILE).is_file()
        if path.suffix != ".mcap":
            return path.name.endswith(ENDING)
        with path.open("rb") as stream:
            return b"demo_rig.json" in stream.read(HEAD)

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return one demonstration, the first of a folder if none is named."""
        from tacdata.demonstrations.paths.tracks_file import ENDING, path_of, read_tracks
        from tacdata.viewers.parts.recorded_images import recorded_images
        from tacdata.viewers.scenes.hand import demonstration_scene

        refuse(options, "a demonstration", *(("episode",) if path.is_dir() else ()))
        recording = _recording(path, options.episode)
        tracks = path if path.name.endswith(ENDING) else path_of(recording)
        demonstration = read_tracks(tracks) if tracks.is_file() else None
        recorded, remarks = _read(recording, demonstration is not None)
        images = recorded_images(recording, tuple(recorded.rig.cameras)) if recorded else ()
        title = f"{recording.resolve().parent.name}/{recording.stem}"
        return demonstration_scene(title, demonstration, recorded, images, remarks)


def _recording(path: Path, episode: int | None) -> Path:
    from tacdata.demonstrations.paths.tracks_file import ENDING
    from tacdata.viewers.kinds.session import episode_of

    if path.is_dir():
        return episode_of(path, episode)
    return path.with_name(path.name.removesuffix(ENDING) + ".mcap") if path.name.endswith(ENDING) else path


def _read(recording: Path, tracked: bool) -> tuple[DemoRecording | None, tuple[str, ...]]:
    """Return the recording; where the tracks alone can be shown, why they are alone."""
    from tacdata.demonstrations.recording.reader import read_demo

    if not tracked:
        return read_demo(recording), ()
    if not recording.is_file():
        return None, ()
    try:
        return read_demo(recording), ()
    except TacdataError as error:
        return None, (f"the recording cannot be read: {error.given}",)
