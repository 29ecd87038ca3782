"""A recorded press, finished, broken off or still being written."""

from pathlib import Path

from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene


class RecordingKind(Kind):
    """One recording with the files of its folder."""

    ORDER, NOUN = 60, "a recording (.mcap)"

    def claims(self, path: Path) -> bool:
        """An MCAP file."""
        return path.is_file() and path.suffix == ".mcap"

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return the press; of a file that is still being written, its part on the disk."""
        from tacdata.viewers.scenes.recording import recording_scene

        refuse(options, "one recording", "labels", "predictions")
        return recording_scene(path, options)
