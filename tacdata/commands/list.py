"""List what can be chosen by name, and its parameters."""

from __future__ import annotations

from typing import Annotated

import typer

from tacdata import catalogue
from tacdata.commands.command import TOOLS

ORDER = 110
PANEL = TOOLS


def run(
    room: Annotated[str, typer.Argument(metavar="[ROOM]", help="A folder of members; without it, all folders.")] = "",
) -> None:
    """List indenters, devices, verbs and every other folder of members, with units."""
    if not room:
        for registry in catalogue.registries().values():
            count = len(catalogue.members(registry.name))
            print(f"{registry.name:<12} {count:>3}  {registry.meaning}")
        print("\nnext: tacdata list ROOM, for example `tacdata list indenters`")
        return
    for member in catalogue.members(room):
        print(f"{member.name:<16} {member.meaning}")
        for name, meaning in member.parameters:
            print(f"{'':<16}   {name}: {meaning}")
