"""Success rates of trials with their 95 % Wilson intervals."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.errors import UsageError

ORDER = 60
PANEL = HANDS
EXAMPLES = (
    "tacdata success trials.csv",
    "tacdata success dense=35/40 sparse=21/40",
    "tacdata success trials.csv --group edge=1,2,7,8 --paper",
)


def run(
    trials: Annotated[
        list[str] | None,
        typer.Argument(metavar="[FILE.csv|NAME=K/N]...", help="Trials one a line, or counts such as dense=35/40."),
    ] = None,
    group: Annotated[
        list[str] | None, typer.Option(help="Positions that belong together: edge=1,2,7,8; give it repeatedly.")
    ] = None,
    paper: Annotated[bool, typer.Option("--paper", help="The paper's own counts, too.")] = False,
) -> Result:
    """Print success rates with 95 % Wilson intervals, by condition, group and position.

    A CSV file has the columns condition and success, and may have position and adjustments.
    """
    from tacdata.training.scoring import success

    if not trials and not paper:
        raise UsageError("no trials", "a CSV file, counts such as dense=35/40, or --paper", "name some")
    groups = {}
    for text in group or []:
        name, _, members = text.partition("=")
        if not (name and members):
            raise UsageError(f"--group {text}", "NAME=POSITION,POSITION,...", "for example edge=1,2,7,8")
        groups[name] = {m.strip() for m in members.split(",")}
    attempts = []
    for text in trials or []:
        if "=" in text and not Path(text).exists():
            attempts.append(success.counted(text))
        else:
            attempts += success.rates(success.read_attempts(Path(text)), groups)
    if attempts:
        print(success.markdown(attempts))
    if paper:
        print("\nThe paper's (Exp. 3, on a real robot):\n\n" + success.markdown(success.published_rates()))
    return Result({"rates": attempts, "published": success.published_rates() if paper else []})
