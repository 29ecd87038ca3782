"""Look at an episode."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import PIPELINE
from tacdata.errors import UsageError

if TYPE_CHECKING:
    from viewers.scene import Scene

ORDER = 70
PANEL = PIPELINE


def run(
    path: Annotated[
        Path, typer.Argument(help="A recording (.mcap), a session or dataset folder, or a saved .rrd file.")
    ],
    labels: Annotated[Path | None, typer.Option(help="Folder of labels; without it SESSION/labels.")] = None,
    predictions: Annotated[Path | None, typer.Option(help="Folder of predictions, or a training run.")] = None,
    episode: Annotated[int | None, typer.Option(min=0, help="Its number there; else the first.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a Rerun file (.rrd) instead of opening a window.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write one page (.png) instead of opening a window.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve Rerun's web viewer on this machine.")] = False,
) -> None:
    """Look at an episode (skin, maps, signals, cameras) in a window or browser, or save it."""
    from viewers import output_file, rerun_window
    from viewers.source import scene_at

    for file, suffix in ((save, output_file.RERUN), (picture, output_file.PICTURE)):
        if file is not None:
            output_file.new_file(file, suffix)
    opens = web or (save is None and picture is None)
    if opens and not web:
        rerun_window.require_display()
    if path.suffix == output_file.RERUN and path.is_file():
        if save or picture:
            raise UsageError(f"{path} with --save or --picture", "a recording, session or dataset", "leave them out")
        _show(path, web)
        return
    scene = scene_at(path, labels, predictions, episode)
    if save is not None:
        _write_rerun(scene, save)
        print(f"saved {save}; look at it with: tacdata view {save}")
    if picture is not None:
        from viewers.picture_backend import PictureBackend

        PictureBackend(picture).draw(scene)
        print(f"saved {picture}")
    if opens:
        with tempfile.TemporaryDirectory(prefix="tacdata-view-") as folder:
            file = save or Path(folder) / "episode.rrd"
            if save is None:
                _write_rerun(scene, file)
            _show(file, web)


def _write_rerun(scene: Scene, file: Path) -> None:
    from viewers.rerun_backend import RerunBackend

    RerunBackend(file).draw(scene)


def _show(file: Path, web: bool) -> None:
    """Open a Rerun file; ends when the window is closed, or with Ctrl-C."""
    from viewers import rerun_window

    with suppress(KeyboardInterrupt):
        if not web:
            rerun_window.window(file)
            return
        with rerun_window.web_server(file) as (server, address):
            print(f"open {address}\nCtrl-C ends it", flush=True)
            if rerun_window.has_display():
                typer.launch(address)
            rerun_window.wait_for(server)
