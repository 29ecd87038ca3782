"""Bring finished labels from a label service to this computer."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service
from tacdata.errors import SolveError
from tacdata.progress import suggest

ORDER = 35
EXAMPLES = (
    "tacdata farm fetch 000001 sessions/monday",
    "tacdata farm fetch 000001 sessions/monday --wait",
    "tacdata farm fetch 000001 sessions/monday --url http://HOST:8765",
)


def run(
    number: Annotated[str, typer.Argument(help="Number of the submission.")],
    session: Annotated[Path, typer.Argument(help="The same recordings on this computer; labels go into it.")],
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
    wait: Annotated[bool, typer.Option("--wait", help="Go on until the submission is finished.")] = False,
    redo: Annotated[bool, typer.Option("--redo", help="Replace labels that were made from something else.")] = False,
) -> Result:
    """Copy finished labels to SESSION/labels; run again, it copies new ones."""
    from time import sleep

    from tacdata.label_farm.remote.client import Client
    from tacdata.label_farm.remote.fetch import Fetch

    client = Client(url, token)
    entry = client.get(client.submission(number))
    fetch = Fetch(client, number, session, redo)
    fetch.bring()
    while wait and entry["state"] in ("waiting", "planning", "running"):
        sleep(1.0)
        # Its state is requested first: labels finished by then are copied below.
        entry = client.get(client.submission(number))
        fetch.bring()
    fetched = fetch.fetched
    print(
        f"labels fetched: {len(fetched.written)}, already here: {len(fetched.current)}, failed: {len(fetched.failed)}"
    )
    for episode, reason in sorted(fetched.failed.items()):
        print(f"  episode {episode}: no label: {reason.splitlines()[0]}")
    summary = {"submission": entry, "fetched": fetched}
    missing = entry["episodes"] - len(fetched.written) - len(fetched.current) - len(fetched.failed)
    if entry["state"] in ("waiting", "planning", "running"):
        print(f"{missing} episodes are still to come: the submission is {entry['state']}")
        suggest("farm fetch", number, session, "--wait")
    elif fetched.failed:
        error = SolveError(
            f"{len(fetched.failed)} of {entry['episodes']} episodes have no label",
            "a label for every episode",
            f"read {session}/labels/episode-*.failure.json; `tacdata farm submit --redo` tries again",
        )
        return Result(summary, error)
    else:
        suggest("pack", session, "--out DATASET")
    return Result(summary)
