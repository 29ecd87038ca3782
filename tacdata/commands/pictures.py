"""Draw the pictures of README and tutorial."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import START, Result
from tacdata.errors import UsageError

ORDER = 90
PANEL = START
EXAMPLES = ("tacdata pictures", "tacdata pictures demo --out docs/pictures", "tacdata pictures demo --verdict verdict")


def run(
    demo: Annotated[Path, typer.Argument(help="What `tacdata demo` made: session, network.")] = Path("demo"),
    out: Annotated[Path, typer.Option(help="Folder for the pictures; those of before are replaced.")] = Path(
        "docs/pictures"
    ),
    verdict: Annotated[Path | None, typer.Option(help="A verdict folder, for its page too.")] = None,
    demonstration: Annotated[Path | None, typer.Option(help="A tracked demonstration, for its page too.")] = None,
) -> Result:
    """Draw the pictures of README and tutorial from the files of the demo: small enough for the repository."""
    from tacdata.viewers.browse.list_sources import episodes_at
    from tacdata.viewers.pictures.small_pictures import small_film, small_page
    from tacdata.viewers.source import scene_at

    session, network = demo / "session", demo / "network"
    if not session.is_dir():
        raise UsageError(f"no session in {demo}", "the folder that `tacdata demo` made", "run `tacdata demo` first")
    predictions = network if (network / "predictions").is_dir() else None
    listed = episodes_at(session, predictions=predictions)
    deepest = max(listed.entries, key=lambda entry: (entry.error is not None, entry.depth or 0.0))
    scene = scene_at(session, predictions=predictions, episode=deepest.number)
    drawn = [small_page(scene, out / "episode.png"), small_film(scene, out / "press.gif")]
    for path, name in ((verdict, "verdict.png"), (demonstration, "demonstration.png")):
        if path is not None:
            drawn.append(small_page(scene_at(path), out / name))
    for path in drawn:
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return Result({"written": [{"file": path, "bytes": path.stat().st_size} for path in drawn]})
