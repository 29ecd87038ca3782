"""Ask a label service for the labels of a session."""

import getpass
import socket
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.commands.farm import command as service
from tacdata.progress import say, suggest

ORDER = 20
EXAMPLES = (
    "tacdata farm submit sessions/monday",
    "tacdata farm submit sessions/monday --into sets/skin",
    "tacdata farm submit sessions/monday --priority 10 --redo",
)


def run(
    session: Annotated[str, typer.Argument(help="Folder of recordings, named from the service's root on.")],
    url: service.Url = service.DEFAULT,
    token: service.Token = "",
    sensor: Annotated[str, typer.Option(help="Sensor file from the root on, if not each recording's own.")] = "",
    into: Annotated[str, typer.Option(help="Dataset from the root on that finished labels flow into.")] = "",
    priority: Annotated[int, typer.Option(min=-1000, max=1000, help="Larger comes first.")] = 0,
    by: Annotated[str, typer.Option(help="Who asks; else your name and computer.")] = "",
    redo: Annotated[
        bool, typer.Option("--redo", help="Replace labels of another model version; retry failed presses.")
    ] = False,
    uncertainty: Annotated[bool, typer.Option(help="Say what the sensor file's spreads make of each pixel.")] = True,
    tolerance: Annotated[float, typer.Option(min=0.0, help="As of `tacdata label` [mm].")] = 0.005,
    load_step: Annotated[float, typer.Option(help="Largest depth step while loading [mm].")] = 0.25,
    unload_step: Annotated[float, typer.Option(help="Depth step up [mm]; a skin on a board needs few.")] = 0.75,
    wait: Annotated[
        float, typer.Option(min=0.0, help="Longest wait for the service to look at the recordings [s].")
    ] = 10.0,
) -> Result:
    """Ask for the labels of a session and walk away; `tacdata farm status` shows the progress."""
    from tacdata.label_farm.remote.client import Client, refusal

    wish = {
        "session": session,
        "by": by or f"{getpass.getuser()}@{socket.gethostname()}",
        "priority": priority,
        "sensor": sensor or None,
        "dataset": into or None,
        "redo": redo,
        "uncertainty": uncertainty,
        "tolerance": tolerance,
        "load_step": load_step,
        "unload_step": unload_step,
    }
    client = Client(url, token)
    filed = client.post("/api/submissions", wish)
    print(f"submission {filed['id']} of {session} is filed", flush=True)
    filed = client.planned(filed["id"], wait) if wait else filed
    # Filing always succeeds; the service refuses when it has read the recordings.
    if filed["state"] == "refused":
        return Result(filed, refusal(filed))
    if wait and filed["state"] in ("waiting", "planning"):
        say(f"the service has not looked at its recordings within {wait:g} s: it may still refuse them")
    suggest("farm status", filed["id"])
    say(f"or open {url} in a browser")
    return Result(filed)
