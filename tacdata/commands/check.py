"""Say whether a recording or session is fit to be labelled."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import PIPELINE

ORDER = 20
PANEL = PIPELINE


def run(
    path: Annotated[Path, typer.Argument(help="A session folder or a recording (MCAP).")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for check.json and check.png; default: the session's.")
    ] = None,
) -> None:
    """Check every stream for gaps, noise, stuck channels and missing tags; exit 0 if usable, 1 if not."""
    from tacdata import documents
    from tacdata.recording.check.report import check
    from viewers.pictures.check import draw

    report = check(path)
    folder = out or (path if path.is_dir() else path.parent)
    stem = "check" if path.is_dir() else f"{path.stem}.check"
    print(report.text, flush=True)  # whatever becomes of the files beside it
    documents.write(folder / f"{stem}.json", report.document, "check")
    if report.episodes:
        draw(report, folder / f"{stem}.png")
        print(f"picture: {folder / f'{stem}.png'}")
    if not report.usable:
        raise typer.Exit(1)
    if path.is_dir():
        print(f"next: tacdata label {path}")
