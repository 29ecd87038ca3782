"""Find which physical effect a model of a sensor lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import TOOLS

ORDER = 160
PANEL = TOOLS


def run(
    recordings: Annotated[
        list[Path], typer.Argument(help="Recordings (.mcap) or session folders; several sessions in one verdict.")
    ],
    out: Annotated[Path, typer.Option(help="New folder for verdict.json, verdict.txt, verdict.png and a new spec.")],
    spec: Annotated[
        Path | None,
        typer.Option(help="Model spec (schemas/model_spec.schema.json); else a response fitted to the recordings."),
    ] = None,
) -> None:
    """Find where recordings and a model disagree, and name the missing effect, or say why not."""
    from rich.console import Console

    from tacdata.discrepancy.run import run as judge
    from tacdata.discrepancy.spec import read_spec

    console = Console(stderr=True)
    model = read_spec(spec)
    with console.status("reading") as status:
        written = judge(recordings, model, out, status.update)
    print(written.text, end="")
    console.print(f"written: {written.folder}", markup=False, highlight=False, soft_wrap=True)
