"""List episodes, choose among them and set bad ones aside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from tacdata.viewers.browse.episode_list import EpisodeList

ORDER = 30
PANEL = DATA
EXAMPLES = (
    "tacdata browse session",
    "tacdata browse dataset --where 'depth>0.8' --sort=-depth",
    "tacdata browse dataset --predictions network --sort error --web",
)


def run(
    path: Annotated[Path, typer.Argument(help="A session or dataset folder.")],
    where: Annotated[
        list[str] | None,
        typer.Option(help="Only those with e.g. depth>0.8, indenter=ball, label=failed, flag!= ; repeatable."),
    ] = None,
    sort: Annotated[str, typer.Option(help="Column to sort by; -COLUMN turns it; error: the worst first.")] = "number",
    predictions: Annotated[
        Path | None, typer.Option(help="Predictions or a training run: its error a episode.")
    ] = None,
    labels: Annotated[Path | None, typer.Option(help="Folder of labels; without it SESSION/labels.")] = None,
    most: Annotated[int, typer.Option(min=1, help="Rows to print.")] = 40,
    flag: Annotated[int | None, typer.Option(help="Set this episode aside; say why with --reason.")] = None,
    unflag: Annotated[int | None, typer.Option(help="Take this episode back.")] = None,
    reason: Annotated[str, typer.Option(help="Why it is set aside.")] = "",
    web: Annotated[
        bool, typer.Option("--web", help="A page on this machine: list, viewer, step from worst to next.")
    ] = False,
    catalogue: Annotated[
        bool, typer.Option("--catalogue", help="Draw all episodes and serve them as a dataset of Rerun's catalogue.")
    ] = False,
) -> Result:
    """List, filter and sort episodes; flag bad ones, which training then leaves out; step through them in a browser."""
    from tacdata.viewers.browse.flagging import flag_episode, unflag_episode
    from tacdata.viewers.browse.list_sources import episodes_at

    if flag is not None or unflag is not None:
        all_episodes = episodes_at(path, labels)
        if flag is not None:
            print(f"set aside: {flag_episode(all_episodes, flag, reason)}")
        if unflag is not None:
            print(f"taken back: {unflag_episode(all_episodes, unflag)}")
        return Result({"set_aside": flag, "taken_back": unflag})
    episodes = episodes_at(path, labels, predictions)
    for condition in where or ():
        episodes = episodes.where(condition)
    episodes = episodes.by(sort)
    if catalogue:
        _catalogue(episodes, labels, predictions, most)
        return Result(None)
    if web:
        _serve(episodes, labels, predictions)
        return Result(None)
    _print(episodes, most, predictions is not None)
    if episodes.entries:
        more = ("--predictions", predictions) if predictions else ()
        suggest("view", path, "--episode", episodes.entries[0].number, *more)
    return Result({"episodes": episodes.entries, "remarks": episodes.remarks})


def _print(episodes: EpisodeList, rows: int, scored: bool) -> None:
    from tacdata.viewers.browse.list_table import list_table

    print(list_table(episodes, rows, scored))
    for remark in episodes.remarks:
        print(f"note: {remark}")


def serve(path: Path, labels: Path | None, predictions: Path | None) -> None:
    """Serve the page of a whole session or dataset, the worst episode first where errors are known."""
    from tacdata.viewers.browse.list_sources import episodes_at

    _serve(episodes_at(path, labels, predictions).by("error" if predictions else "number"), labels, predictions)


def _catalogue(episodes: EpisodeList, labels: Path | None, predictions: Path | None, rows: int) -> None:
    from tacdata.viewers.browse.catalogue import catalogue_server
    from tacdata.viewers.rerun import window

    def drawn(count: int, total: int) -> None:
        say(f"  {count} of {total} episodes drawn")

    with catalogue_server(episodes, labels, predictions, drawn) as served:
        print(f"open {served.whole}\ncatalogue {served.address}")
        if served.dataset:
            for entry in episodes.entries[:rows]:
                print(f"episode {entry.number} at its deepest: {served.at_deepest(entry.number)}")
        else:
            say("Rerun lays them out itself; `pip install 'rerun-sdk[catalog]'` brings our layout and links to moments")
        print("Ctrl-C ends it", flush=True)
        if window.has_display():
            typer.launch(served.whole)
        window.until_interrupted()


def _serve(episodes: EpisodeList, labels: Path | None, predictions: Path | None) -> None:
    from tacdata.viewers.browse.server import browse_server
    from tacdata.viewers.rerun import window

    with browse_server(episodes, labels, predictions) as address:
        print(f"open {address}\nCtrl-C ends it", flush=True)
        if window.has_display():
            typer.launch(address)
        window.until_interrupted()
