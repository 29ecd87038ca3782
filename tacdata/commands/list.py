"""List members of registries by name, with their parameters."""

from dataclasses import asdict
from typing import Annotated, Any

import typer

from tacdata import catalogue, registry
from tacdata.commands.command import START, TASKS, Result, members
from tacdata.progress import say

ORDER = 30
PANEL = START
EXAMPLES = ("tacdata list", "tacdata list verbs", "tacdata list indenters --json")


def run(
    room: Annotated[str, typer.Argument(metavar="[ROOM]", help="A folder of members; without it, all folders.")] = "",
) -> Result:
    """List indenters, devices, verbs and every other folder of members, with units."""
    if not room:
        folders = [
            {"name": kind.name, "members": len(catalogue.members(kind.name)), "meaning": kind.meaning}
            for kind in catalogue.registries().values()
        ]
        for folder in folders:
            print(f"{folder['name']:<12} {folder['members']:>3}  {folder['meaning']}")
        say("\nnext: tacdata list ROOM, for example `tacdata list indenters`")
        return Result(folders)
    if room in ("verbs", "commands"):
        return Result(_verbs())
    entries = catalogue.members(room)
    for member in entries:
        print(f"{member.name:<16} {member.meaning}")
        for name, meaning in member.parameters:
            print(f"{'':<16}   {name}: {meaning}")
    kind = catalogue.registries()[room]
    folder = registry.source(kind.room, kind.base).parent
    say(f"\nnext: to add one, copy a file of {folder} as a plug-in ({registry.HELP})")
    return Result([{**asdict(member), "parameters": dict(member.parameters)} for member in entries])


def _verbs() -> list[dict[str, Any]]:
    """Print the verbs by task; return name, task, meaning and examples of each."""
    verbs = []
    for module, name in members("tacdata.commands", "command"):
        meaning, examples = (module.run.__doc__ or "").split("\n")[0], getattr(module, "EXAMPLES", ())
        verbs.append({"name": name, "task": module.PANEL, "meaning": meaning, "examples": examples})
    for task in TASKS:
        print(task)
        for verb in verbs:
            if verb["task"] == task:
                print(f"  {verb['name']:<16} {verb['meaning']}")
    say("\nnext: tacdata VERB -h, for example `tacdata record -h`")
    return verbs
