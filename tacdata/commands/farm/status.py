"""Say how far a label service is."""

from typing import Annotated, Any

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service
from tacdata.errors import SolveError, UsageError
from tacdata.progress import suggest

ORDER = 30
EXAMPLES = ("tacdata farm status", "tacdata farm status 000001 --wait", "tacdata farm status --json")


def run(
    number: Annotated[str, typer.Argument(help="Submission; without it, all.")] = "",
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
    wait: Annotated[bool, typer.Option("--wait", help="Until the submission is finished; needs its number.")] = False,
) -> Result:
    """Print submissions, their progress, the workers, and reasons of failed presses."""
    from time import sleep

    from tacdata.label_farm.remote.client import Client

    client = Client(url, token)
    if wait and not number:
        raise UsageError("--wait without a submission", "the number of one", "see `tacdata farm status`")
    if not number:
        state = client.get("/api/state")
        _all(state)
        return Result(state)
    entry = client.get(client.submission(number))
    # The service is asked, and not its folder: it may be on another computer.
    while wait and entry["state"] in ("waiting", "planning", "running"):
        sleep(1.0)
        entry = client.get(client.submission(number))
    _line(entry)
    for episode, reason in entry.get("failures", {}).items():
        print(f"  episode {episode}: no label: {reason.splitlines()[0]}")
    if entry["reason"]:
        print(f"  {entry['reason']}")
    if entry["state"] == "refused" or (wait and entry["failed"]):
        refused = entry["state"] == "refused"
        error = SolveError(
            f"submission {number} " + ("is refused" if refused else f"left {entry['failed']} episodes without a label"),
            "a label for every episode",
            "mend what is said above and submit again",
        )
        return Result(entry, error)
    if entry["state"] == "done":
        print(f"labels lie in {entry['session']}/labels under the service's root; on another computer:")
        suggest("farm fetch", number, "SESSION")
    return Result(entry)


def _line(entry: dict[str, Any]) -> None:
    remaining = f", {entry['presses_left']} presses to go" if entry.get("presses_left") else ""
    print(
        f"{entry['id']}  {entry['state']:9}  {entry['labelled']} of {entry['episodes']} labelled, "
        f"{entry['failed']} failed{remaining}  {entry['session']}  (by {entry['by']}, priority {entry['priority']})"
    )


def _all(state: dict[str, Any]) -> None:
    for entry in state["submissions"]:
        _line(entry)
    if not state["submissions"]:
        print("nothing was submitted yet: tacdata farm submit SESSION")
    presses = state["presses"]
    print(
        f"presses: {presses['waiting']} waiting, {presses['in_work']} in work, {presses['solved']} solved, "
        f"{presses['failed']} failed"
    )
    for row in state["workers"]:
        print(
            f"worker {row['owner']} on {row['device']}: {row['done']} solved, {60 * row['rate']:.1f} a minute"
            + (f"; {row['note']}" if row["note"] else "")
        )
    if state["seconds_left"]:
        print(f"about {state['seconds_left'] / 60:.1f} min left")
    if state["paused"]:
        print(f"paused: {state['paused']}")
