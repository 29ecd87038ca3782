"""Change a submission's priority."""

from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service

ORDER = 50
EXAMPLES = (
    "tacdata farm priority 000001 10",
    "tacdata farm priority 000001 0 --url http://HOST:8765",
    "tacdata farm priority 000001 100 --json",
)


def run(
    number: Annotated[str, typer.Argument(help="Number of the submission.")],
    priority: Annotated[int, typer.Argument(min=-1000, max=1000, help="Larger comes first.")],
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
) -> Result:
    """Change a submission's priority; its waiting presses move at once."""
    from tacdata.label_farm.remote.client import Client

    client = Client(url, token)
    client.post(f"{client.submission(number)}/priority", {"priority": priority})
    print(f"submission {number} has priority {priority}")
    return Result({"submission": number, "priority": priority})
