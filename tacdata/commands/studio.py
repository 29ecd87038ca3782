"""List everything that a lab has, on one page."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import START, Result

ORDER = 40
PANEL = START
EXAMPLES = ("tacdata studio", "tacdata studio lab", "tacdata studio lab --list --json")


def run(
    folder: Annotated[Path, typer.Argument(help="Folder with sessions, datasets, networks, verdicts.")] = Path("."),
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port; 0 for any that is free; default: 9097, if free.")
    ] = None,
    once: Annotated[bool, typer.Option("--list", help="Print the list and end.")] = False,
) -> Result:
    """Show sessions, datasets, networks, verdicts and a recording that runs on one page of this computer.

    It reads, and stops a recording on request. Its next steps are commands to copy.
    """
    from tacdata.studio.inventory import Inventory

    inventory = Inventory(folder)
    if once:
        entries = inventory.entries()
        for entry in entries:
            words = filter(None, (entry.sentence, *entry.facts, *entry.faults))
            print(f"{entry.section}: {entry.path}: {'; '.join(words)}")
            for line in entry.commands[:1]:
                print(f"  {line}")
        if not entries:
            print(f"{folder} holds no sessions, datasets or verdicts yet")
        return Result({"root": inventory.root, "entries": entries})
    from tacdata.studio.server import PORT, studio_server
    from tacdata.viewers.rerun import window

    with studio_server(inventory, window.free_port(PORT) if port is None else port) as address:
        print(f"open {address}\nCtrl-C ends it", flush=True)
        if window.has_display():
            typer.launch(address)
        window.until_interrupted()
    return Result({"root": inventory.root})
