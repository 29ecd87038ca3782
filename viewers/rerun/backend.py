"""Draws scenes with Rerun, into a file that `viewers.rerun.window` or any Rerun viewer shows."""

from pathlib import Path

import rerun as rr

from tacdata.viewers.backend import Backend
from tacdata.viewers.output_file import RERUN, new_file, written_beside
from tacdata.viewers.rerun.blueprint import episode_blueprint
from tacdata.viewers.rerun.columns import RerunParts
from tacdata.viewers.rerun.comparison_blueprint import comparison_blueprint
from tacdata.viewers.rerun.hand_blueprint import hand_blueprint
from tacdata.viewers.rerun.verdict_blueprint import verdict_blueprint
from tacdata.viewers.scene.scene import Scene

APPLICATION = "tacdata"
LAYOUTS = {
    "episode": episode_blueprint,
    "hand": hand_blueprint,
    "verdict": verdict_blueprint,
    "comparison": comparison_blueprint,
}
"""Kind of a scene -> its layout."""


class RerunBackend(Backend):
    """Writes each scene into a file (.rrd) that the stock Rerun viewer opens."""

    def __init__(self, path: Path, recording: str | None = None) -> None:
        """Take the file to write, and a name of its content, by which Rerun distinguishes recordings.

        Raises:
            UsageError: If it exists or does not end in .rrd.
        """
        self._path, self._recording = new_file(path, RERUN), recording

    def draw(self, scene: Scene) -> None:
        """Write the file; a crash leaves none rather than half of one."""
        with written_beside(self._path) as temporary:
            recording = rr.RecordingStream(APPLICATION, recording_id=self._recording)
            recording.save(temporary, default_blueprint=LAYOUTS[scene.kind](scene))
            recording.send_recording_name(scene.title)
            RerunParts(recording, scene).write()
            recording.flush()
            recording.disconnect()
