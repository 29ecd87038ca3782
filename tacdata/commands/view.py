"""Look at an episode."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands import browse
from tacdata.commands.command import DATA, Result
from tacdata.errors import UsageError
from tacdata.progress import say

ORDER = 20
PANEL = DATA
EXAMPLES = (
    "tacdata view session",
    "tacdata view session --episode 3 --predictions network",
    "tacdata view verdict --picture verdict.png",
)


def run(
    path: Annotated[
        Path,
        typer.Argument(
            help="A recording (.mcap), session, dataset, predictions, demonstration, tracks, folder of targets, "
            "verdict or revision, or a saved .rrd file."
        ),
    ],
    labels: Annotated[Path | None, typer.Option(help="Folder of labels; without it SESSION/labels.")] = None,
    predictions: Annotated[Path | None, typer.Option(help="Folder of predictions, or a training run.")] = None,
    episode: Annotated[int | None, typer.Option(min=0, help="Its number there; else the first.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a Rerun file (.rrd) instead of opening a window.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write one page (.png) instead of opening a window.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film (.mp4 or .gif) instead of opening a window.")] = None,
    web: Annotated[
        bool, typer.Option("--web", help="In a browser, served on this machine; a folder as a list.")
    ] = False,
    foxglove: Annotated[
        Path | None, typer.Option(help="Write a layout (.json) with which Foxglove shows the recording itself.")
    ] = None,
) -> Result:
    """Look at an episode, a demonstration, targets or a verdict, in a window or browser, or save the view."""
    from tacdata.viewers import output_file, showing
    from tacdata.viewers.live import following
    from tacdata.viewers.source import scene_at

    if foxglove is not None:
        from tacdata.viewers.foxglove_layout import write_foxglove_layout

        write_foxglove_layout(path, foxglove)
        print(f"saved {foxglove}; in Foxglove open {path}, then Layouts, Import from file")
        return Result({"written": [foxglove]})
    path = viewable(following.meant(path) if episode is None else path)
    # Refused before a long file is read.
    output = showing.Output(save, picture, video, web)
    output.check()
    if path.suffix == output_file.RERUN and path.is_file():
        showing.show_saved(path, output)
        return Result({"shown": path, "written": []})
    if output.opens and following.is_growing(path) and not output.files:
        following.follow(path, web)
        return Result({"shown": path, "written": []})
    if output.only_web and episode is None and _is_list(path):
        browse.serve(path, labels, predictions)
        return Result({"shown": path, "written": []})
    scene = scene_at(path, labels, predictions, episode, output.prepare)
    showing.show(scene, output)
    return Result({"shown": scene.title, "found": scene.found, "written": output.files})


def viewable(path: Path) -> Path:
    """Return a path, or the only thing to view in a folder that is none itself.

    Raises:
        UsageError: If there is nothing there, or a folder holds several things to view.
    """
    from tacdata.viewers.kinds.kind import contents, kind_of

    if not path.exists():
        kind_of(path)  # refuses: a wrong path is named before a missing display
    if not path.is_dir() or kind_of(path).holds(path):
        return path
    entries = contents(path)
    if len(entries) > 1:
        listed = "; ".join(f"{entry} ({kind.NOUN})" for entry, kind in entries.items())
        raise UsageError(f"{path} holds {len(entries)} things to view", listed, f"tacdata view {next(iter(entries))}")
    for entry, kind in entries.items():
        say(f"{path} holds {kind.NOUN}: {entry}")
    return next(iter(entries), path)


def _is_list(path: Path) -> bool:
    """Say whether a folder holds episodes to choose from: a dataset of ours, or a session."""
    return (path / "meta" / "tacdata.json").is_file() or (path / "session.json").is_file()
