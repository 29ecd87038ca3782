"""Solve one press with the skin model, from a case file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import TOOLS

ORDER = 130
PANEL = TOOLS


def run(
    case: Annotated[Path, typer.Argument(help="Case file (schemas/case.schema.json).")],
    out: Annotated[Path, typer.Option(help="Folder for NAME.json (forces), NAME.parquet (displacements).")] = Path("."),
) -> None:
    """Solve one press with the skin model: displacements of the outer face and forces, as files."""
    from rich.console import Console

    from tacdata.skin.case import read_case, solve_case

    console = Console(stderr=True)
    wanted = read_case(case)
    with console.status(f"{wanted.name}: meshing and factorizing") as status:
        report = solve_case(wanted, out, lambda depth: status.update(f"{wanted.name}: {depth:g} mm solved"))
    print(report)
