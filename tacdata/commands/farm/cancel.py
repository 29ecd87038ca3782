"""Take a submission back."""

from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service

ORDER = 40
EXAMPLES = (
    "tacdata farm cancel 000001",
    "tacdata farm cancel 000001 --url http://HOST:8765",
    "tacdata farm cancel 000001 --json",
)


def run(
    number: Annotated[str, typer.Argument(help="Number of the submission.")],
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
) -> Result:
    """Take a submission back; labels that are finished stay."""
    from tacdata.label_farm.remote.client import Client

    client = Client(url, token)
    entry = client.post(f"{client.submission(number)}/cancel")
    print(f"submission {number} is cancelled: {entry['labelled']} of {entry['episodes']} labels lie there")
    return Result(entry)
