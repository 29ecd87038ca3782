"""Fetch a set of data by name."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import START, Result
from tacdata.progress import suggest

ORDER = 15
PANEL = START
EXAMPLES = ("tacdata fetch", "tacdata fetch damper", "tacdata fetch presses --out data --mirror http://HOST/sets")


def run(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Name of a set; without it, all are listed.")] = "",
    out: Annotated[Path | None, typer.Option(help="Folder for its files; default: the set's name.")] = None,
    mirror: Annotated[
        str, typer.Option(envvar="TACDATA_MIRROR", help="Address, or folder here, that holds the folder NAME/.")
    ] = "",
) -> Result:
    """Fetch a set of recordings by name from its authors or a release, and compare it with its hashes."""
    from tacdata.example.fetched import MAPPING, fetch, published_sets

    sets = published_sets()
    if not name:
        for each, record in sets.items():
            print(f"{each:<10} {record['meaning']}\n{'':<10} {record['source']}; {record['licence']}")
        suggest("fetch", "NAME")
        return Result(sets)
    target = fetch(name, out or Path(name), mirror)
    print(f"{name}: {target}, compared with its hashes; {sets[name]['licence']}, {sets[name]['source']}")
    if "mapping" in sets[name]:
        suggest("import", target, "--mapping", target / MAPPING, "--out", f"{target}-session")
    else:
        suggest("check", target)
    return Result({"name": name, "folder": target, **sets[name]})
