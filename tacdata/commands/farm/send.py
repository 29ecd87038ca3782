"""Bring a session of this computer to a label service that cannot see its folder."""

from pathlib import Path, PurePath
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service
from tacdata.progress import suggest

ORDER = 15
EXAMPLES = (
    "tacdata farm send sessions/monday",
    "tacdata farm send sessions/monday --to monday",
    "tacdata farm send sessions/monday --url http://HOST:8765",
)


def run(
    session: Annotated[Path, typer.Argument(help="Folder of recordings on this computer.")],
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
    to: Annotated[
        str, typer.Option(help="Where it is to lie, from the service's root on; else the folder's name.")
    ] = "",
) -> Result:
    """Send a session's recordings to the service; run again, it goes on. Not needed where it sees the same disk."""

    from tacdata.label_farm.remote.client import Client
    from tacdata.label_farm.remote.send import send

    name = to or session.resolve().name
    sent = send(Client(url, token), session, name)
    print(f"files sent: {sent.files} ({sent.size / 1e6:.1f} MB), already there: {sent.there}")
    suggest("farm submit", PurePath(name))
    suggest("farm fetch NUMBER", session, "--wait")
    return Result(sent)
