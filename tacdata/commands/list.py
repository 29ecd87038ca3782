"""List members of registries by name, with their parameters."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from tacdata import catalogue
from tacdata.commands.command import TOOLS, Result
from tacdata.progress import say

ORDER = 110
PANEL = TOOLS


def run(
    room: Annotated[str, typer.Argument(metavar="[ROOM]", help="A folder of members; without it, all folders.")] = "",
) -> Result:
    """List indenters, devices, verbs and every other folder of members, with units."""
    if not room:
        folders = [
            {"name": registry.name, "members": len(catalogue.members(registry.name)), "meaning": registry.meaning}
            for registry in catalogue.registries().values()
        ]
        for folder in folders:
            print(f"{folder['name']:<12} {folder['members']:>3}  {folder['meaning']}")
        say("\nnext: tacdata list ROOM, for example `tacdata list indenters`")
        return Result(folders)
    members = catalogue.members(room)
    for member in members:
        print(f"{member.name:<16} {member.meaning}")
        for name, meaning in member.parameters:
            print(f"{'':<16}   {name}: {meaning}")
    return Result([{**asdict(member), "parameters": dict(member.parameters)} for member in members])
