"""Shows a recording while it is being written: the present content, then additions, until it ends."""

from __future__ import annotations

import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from tacdata.errors import DeviceError, TacdataError, UsageError
from tacdata.recording.files import file_names
from tacdata.viewers.scene.newest_part import ScenePart, open_ended
from tacdata.viewers.scene.scene import Scene

if TYPE_CHECKING:
    import rerun as rr

    from tacdata.viewers.live.fed_viewer import FedViewer

PAUSE = 0.5
"""Least time between two looks at the file [s]; its chunks are closed about as often."""
SHARE = 4.0
"""How many times as long as a look takes is waited for the next: a long recording takes longer to read through."""


class Follower:
    """Draws one growing recording into a Rerun recording."""

    def __init__(self, path: Path, recording: rr.RecordingStream) -> None:
        """Open the file. Raises as `tacdata.recording.files.growing_file.GrowingFile`."""
        from tacdata.recording.files.growing_file import GrowingFile
        from tacdata.viewers.parts.recorded_images import ImageSampler

        self._sampler = ImageSampler()
        self._file = GrowingFile(path, self._sampler.take)
        self._recording, self._part, self._layout = recording, ScenePart(), ()
        self.frames = 0
        """Taxel frames that were drawn."""

    @property
    def finished(self) -> bool:
        """Whether the recorder closed the file."""
        return self._file.finished

    def step(self) -> bool:
        """Draw additions; return whether there was anything to draw."""
        if not self._file.update():
            return False
        scene = self._scene()
        if scene is None:
            return False
        self._lay_out(scene)
        from tacdata.viewers.rerun.columns import RerunParts

        RerunParts(self._recording, self._part.newer(scene)).write()
        self._recording.flush()
        self.frames = len(scene.frame_ns)
        return True

    def _scene(self) -> Scene | None:
        """Return the content so far, or None if that is too little to be drawn."""
        from dataclasses import replace

        from tacdata.recording.files.reader import recording_of
        from tacdata.viewers.scenes.recording import scene_of

        remarks = () if self.finished else ("being recorded: it goes on while you look",)
        try:
            scene = scene_of(recording_of(self._file.records), self._sampler, remarks=remarks)
        except TacdataError:
            if self.finished:
                raise
            return None
        return scene if self.finished else replace(scene, phases=open_ended(scene.phases))

    def _lay_out(self, scene: Scene) -> None:
        """Send the layout again where another view or another scale belongs into it."""
        from tacdata.viewers.rerun.blueprint import episode_blueprint

        # Sent only on a change: each new layout resets what the person has moved or hidden.
        scales = tuple((a.scale.low, a.scale.high) for a in scene.arrays)
        layout = (scales, bool(scene.phases), tuple(c.name for c in scene.curves), len(scene.bodies))
        if layout != self._layout:
            self._recording.send_blueprint(episode_blueprint(scene, follows=True))
            self._recording.send_recording_name(scene.title)
            self._layout = layout

    def close(self) -> None:
        """Let the file go."""
        self._file.close()


def is_growing(path: Path) -> bool:
    """Say whether a recording of a press has no end yet, by its name: it is being written, or a crash left it."""
    from tacdata.viewers.kinds.kind import kind_of
    from tacdata.viewers.kinds.recording import RecordingKind

    return path.is_file() and path.name.endswith(file_names.PARTIAL) and isinstance(kind_of(path), RecordingKind)


def meant(path: Path) -> Path:
    """Return the recording of a path: one that has ended since, or a session's first that has not.

    Any other path is itself.
    """
    if path.is_dir() and not file_names.finished(path):
        return next((part for part in file_names.unfinished(path) if is_growing(part)), path)
    finished_path = path.with_name(path.name.removesuffix(file_names.PARTIAL) + ".mcap")
    has_ended = path.name.endswith(file_names.PARTIAL) and not path.exists() and finished_path.is_file()
    return finished_path if has_ended else path


def follow(path: Path, web: bool) -> None:
    """Show a recording that is being written, then those that follow it in its session, in a window or a browser.

    Ends when the window is closed, or with Ctrl-C.

    Args:
        path: The recording.
        web: Serve Rerun's web viewer instead of a window.

    Raises:
        UsageError: If there is no display for a window.
        FormatError: If it is no recording of a press.
        DeviceError: If the viewer does not start.
    """
    from tacdata.recording.live.interruption import Interruption
    from tacdata.viewers.live.fed_viewer import fed_viewer
    from tacdata.viewers.rerun.window import has_display

    try:
        # Rerun's finalizers would swallow a Ctrl-C, and the viewer would stay.
        with suppress(KeyboardInterrupt), fed_viewer(web) as viewer, Interruption() as ctrl_c, ctrl_c.kept():
            if web:
                print(f"open {viewer.address}", flush=True)
                if has_display():
                    webbrowser.open(viewer.address)
            print(f"following {path.name}; Ctrl-C ends the viewer, never the recording", flush=True)
            remains = set(file_names.unfinished(path.parent))  # remains of crashes are not waited for
            visited, following = remains, path
            while viewer.process.poll() is None:
                ctrl_c.check()
                if following is None:
                    time.sleep(PAUSE)
                else:
                    _follow_one(following, viewer, ctrl_c.check)
                    visited.add(following)
                begun = (part for part in file_names.unfinished(path.parent) if is_growing(part))
                following = next((part for part in begun if part not in visited), None)
    except TimeoutError as error:
        fault = f"the viewer does not start: {error}"
        raise DeviceError(fault, "a viewer that listens on the loopback", "use --save FILE.rrd, or --web") from None


def _follow_one(path: Path, viewer: FedViewer, check: Callable[[], None]) -> None:
    """Draw one recording until it ends, the viewer is closed, or a check raises."""
    import rerun as rr

    from tacdata.viewers.rerun.backend import APPLICATION

    recording = rr.RecordingStream(APPLICATION)
    viewer.connect(recording)
    try:
        follower = Follower(path, recording)
    except UsageError:  # it ended, and has its own name by now
        return
    is_noted = False
    try:
        while not follower.finished and viewer.process.poll() is None:
            check()
            begun = time.monotonic()
            if not (follower.step() or follower.frames or is_noted):
                print(f"{path.name}: waiting for the first readings", flush=True)
                is_noted = True
            if not follower.finished:
                time.sleep(max(PAUSE, SHARE * (time.monotonic() - begun)))
        if follower.finished:
            name = path.name.removesuffix(file_names.PARTIAL)
            print(f"{name} has ended: {follower.frames} frames", flush=True)
    finally:
        follower.close()
        recording.disconnect()
