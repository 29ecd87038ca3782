"""Bring foreign recordings in."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.errors import Exit, UsageError
from tacdata.progress import say, suggest

ORDER = 10
PANEL = DATA
EXAMPLES = (
    "tacdata import measured --propose mapping.yaml",
    "tacdata import measured --mapping mapping.yaml --out session",
    "tacdata import measured --web",
)


def run(
    source: Annotated[
        Path, typer.Argument(help="A folder or file of measured data: CSV, Excel, JSON, NumPy, MATLAB, Parquet.")
    ],
    mapping: Annotated[
        Path | None,
        typer.Option(help="Mapping file: columns, units, clocks. Left out: the contents of the source are listed."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Session folder to create.")] = None,
    propose: Annotated[
        Path | None, typer.Option(help="Without --mapping: a mapping to start from, to be written here.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Assign the columns on a page of this computer.")] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port of the page; 0 for any that is free; default: 9099.")
    ] = None,
) -> Result:
    """Turn measured data of another rig into recordings that every other verb reads, by a mapping file."""
    import tacdata as td

    if web:
        return _on_a_page(source, mapping, propose, out, port)
    if mapping is None:
        return _inspect(source, propose)
    if out is None or propose is not None:
        raise td.UsageError(
            "--mapping without --out" if out is None else "--mapping with --propose",
            "--mapping FILE --out SESSION, or --propose FILE alone",
            "add --out, or leave --propose out",
        )
    imported = td.import_files(source, mapping, out, progress=say)
    for note in _together(imported.notes):
        print(f"note: {note}")
    for text in imported.refused:
        print(f"left out: {text}")
    print(
        f"{imported.recordings} recordings in {imported.folder}"
        + f", {len(imported.refused)} left out" * bool(imported.refused)
    )
    suggest("check", imported.folder)
    return Result(imported, Exit.FORMAT if imported.refused else Exit.DONE)


def _together(notes: tuple[str, ...]) -> list[str]:
    """Return notes with those that say the same of several files as one."""
    # A hundred files with one fault would otherwise fill the terminal with the same sentence.
    files: dict[str, list[str]] = {}
    for note in notes:
        name, colon, message = note.partition(": ")
        files.setdefault(message if colon and "." in name else note, []).append(name)
    joined = {text: f"{names[0]} and {len(names) - 1} more files: {text}" for text, names in files.items() if names[1:]}
    return [joined.get(text) or next(note for note in notes if note.endswith(text)) for text in files]


def _inspect(source: Path, propose: Path | None) -> Result:
    from tacdata import documents
    from tacdata.importing.proposing.description import described
    from tacdata.importing.proposing.proposal import proposed_mapping
    from tacdata.importing.proposing.trial_run import tried

    if propose is not None and propose.exists():
        raise UsageError(f"{propose} exists", "a new file; nothing is overwritten", "choose another --propose")
    kinds, text = described(source)
    print(text)
    proposal = proposed_mapping(source, kinds)
    result = {"mapping": proposal.document, "questions": list(proposal.questions)}
    if propose is None:
        suggest("import", source, "--propose mapping.yaml")
        return Result(result)
    documents.write(propose, proposal.document, "import_mapping")
    # As comments at the top: the file stays valid, and the questions stay until a person deletes them.
    heads = "".join(f"# ? {question}\n" for question in proposal.questions)
    propose.write_text(heads + propose.read_text(encoding="utf-8"), encoding="utf-8")
    print(f"a mapping to start from is in {propose}; read it over, it rests on names, units and values")
    for question in proposal.questions:
        print(f"  ? {question}")
    print(tried(source, proposal.mapping))
    suggest("import", source, "--mapping", propose, "--out SESSION")
    return Result({**result, "written": propose})


def _on_a_page(source: Path, mapping: Path | None, propose: Path | None, out: Path | None, port: int | None) -> Result:
    from tacdata.studio.wizard.server import PORT, wizard_server
    from tacdata.studio.wizard.wizard import Wizard
    from tacdata.viewers.rerun import window

    target = propose or mapping or Path(f"{source.resolve().stem}-mapping.yaml")
    wizard = Wizard.of(source, target, out or Path(f"{source.resolve().stem}-session"), mapping)
    with wizard_server(wizard, window.free_port(PORT) if port is None else port) as address:
        print(f"open {address}\nCtrl-C ends it", flush=True)
        if window.has_display():
            typer.launch(address)
        window.until_interrupted()
    return Result({"source": source, "mapping": target if target.exists() else None})
