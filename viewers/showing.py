"""Shows a scene as a person asked: a window, a browser, or files that need no display."""

import tempfile
import webbrowser
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.viewers import output_file
from tacdata.viewers.rerun import window
from tacdata.viewers.rerun.steering import Moment, deepest_moment
from tacdata.viewers.scene.scene import Scene


@dataclass(frozen=True)
class Output:
    """Where a scene goes; without any of these into a window."""

    save: Path | None = None
    """New Rerun file (.rrd)."""
    picture: Path | None = None
    """New page (.png)."""
    video: Path | None = None
    """New film (.mp4 or .gif)."""
    web: bool = False
    """Serve Rerun's web viewer on this machine."""

    @property
    def opens(self) -> bool:
        """Whether somebody is to look now."""
        return self.web or not self.files

    @property
    def only_web(self) -> bool:
        """Whether a browser is all that is asked for."""
        return self.web and not self.files

    @property
    def files(self) -> list[Path]:
        """The files that are asked for."""
        return [file for file in (self.save, self.picture, self.video) if file]

    def prepare(self) -> None:
        """Import the drawing packages, which takes as long as reading a large file."""
        import tacdata.viewers.scenes.episode

        import_module("trimesh.creation")  # of which indenters are made
        if self.save is not None or self.opens:
            import tacdata.viewers.rerun.backend
        if self.picture is not None:
            import tacdata.viewers.pictures.backend  # noqa: F401

    def check(self) -> None:
        """Refuse impossible requests, before anything is read.

        Raises:
            UsageError: If a file exists or has a wrong ending, or there is no display for a window.
        """
        for file, suffixes in (
            (self.save, (output_file.RERUN,)),
            (self.picture, (output_file.PICTURE,)),
            (self.video, output_file.FILMS),
        ):
            if file is not None:
                output_file.new_file(file, *suffixes)
        if self.opens and not self.web:
            window.require_display()


def show(scene: Scene, output: Output) -> None:
    """Write the requested files, then open the windows.

    Raises:
        UsageError: If a file exists, or the viewer breaks down.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.viewers.showing import Output, show
        >>> from tacdata.viewers.source import scene_at
        >>> show(scene_at(Path("session/episode-000000.mcap")), Output(picture=Path("press.png")))
        saved press.png
    """
    if output.save is not None:
        # Files first: a window may stay open for hours.
        write_rerun(scene, output.save)
        print(f"saved {output.save}; look at it with: tacdata view {output.save}")
    if output.picture is not None:
        from tacdata.viewers.pictures.backend import PictureBackend

        PictureBackend(output.picture).draw(scene)
        print(f"saved {output.picture}")
    if output.video is not None:
        from tacdata.viewers.pictures.film import FilmBackend

        FilmBackend(output.video).draw(scene)
        print(f"saved {output.video}")
    if output.opens:
        with tempfile.TemporaryDirectory(prefix="tacdata-view-") as folder:
            file = output.save or Path(folder) / "episode.rrd"
            if output.save is None:
                write_rerun(scene, file)
            show_file(file, output.web, deepest_moment(scene))


def show_saved(path: Path, output: Output) -> None:
    """Open a Rerun file that was saved.

    Raises:
        UsageError: If it is to be saved or drawn again.
    """
    if output.files:
        fault = f"{path} with --save, --picture or --video"
        raise UsageError(fault, "a recording, session, dataset, ...", "leave them out")
    show_file(path, output.web)


def write_rerun(scene: Scene, file: Path) -> None:
    """Write a Rerun file."""
    from tacdata.viewers.rerun.backend import RerunBackend

    RerunBackend(file).draw(scene)


def show_file(file: Path, web: bool, moment: Moment | None = None) -> None:
    """Open a Rerun file, at a moment if one is given; ends when the window is closed, or with Ctrl-C."""
    with suppress(KeyboardInterrupt):
        if not web:
            window.window(file, moment)
            return
        with window.web_server(file, moment) as (server, address):
            print(f"open {address}\nCtrl-C ends it", flush=True)
            if window.has_display():
                webbrowser.open(address)
            window.wait_for(server)
