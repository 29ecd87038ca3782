"""Bring foreign recordings in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import PIPELINE, Result
from tacdata.errors import Exit
from tacdata.progress import say, suggest

ORDER = 15
PANEL = PIPELINE


def run(
    source: Annotated[Path, typer.Argument(help="A folder or file of measured data: CSV, NPZ, Parquet, MATLAB.")],
    mapping: Annotated[
        Path | None, typer.Option(help="Mapping file: columns, units, clocks. Left out: says what is in the source.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Session folder to create.")] = None,
    propose: Annotated[
        Path | None, typer.Option(help="Without --mapping: a mapping to start from, to be written here.")
    ] = None,
) -> Result:
    """Turn measured data of another rig into recordings that every other verb reads, by a mapping file."""
    from tacdata.errors import UsageError
    from tacdata.importing.imported_session import import_session

    if mapping is None:
        return _inspect(source, propose)
    if out is None or propose is not None:
        raise UsageError(
            "--mapping without --out" if out is None else "--mapping with --propose",
            "--mapping FILE --out SESSION, or --propose FILE alone", "add --out, or leave --propose out",
        )  # fmt: skip
    made = import_session(source, mapping, out, progress=say)
    for note in made.notes:
        print(f"note: {note}")
    for text in made.refused:
        print(f"left out: {text}")
    print(f"{made.recordings} recordings in {made.folder}" + f", {len(made.refused)} left out" * bool(made.refused))
    suggest("check", made.folder)
    return Result(made, Exit.FORMAT if made.refused else Exit.DONE)


def _inspect(source: Path, propose: Path | None) -> Result:
    from tacdata import documents
    from tacdata.errors import UsageError
    from tacdata.importing.proposal import described, proposed_mapping

    if propose is not None and propose.exists():
        raise UsageError(f"{propose} exists", "a new file; nothing is overwritten", "choose another --propose")
    tables, text = described(source)
    print(text)
    mapping = proposed_mapping(source, tables)
    if propose is None:
        suggest("import", source, "--propose mapping.yaml")
        return Result({"mapping": mapping})
    documents.write(propose, mapping, "import_mapping")
    print(f"a mapping to start from is in {propose}; correct it by hand, its guesses are guesses")
    suggest("import", source, "--mapping", propose, "--out SESSION")
    return Result({"mapping": mapping, "written": propose})
