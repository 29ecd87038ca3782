"""Say whether a recording or session is fit to be labelled."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import DeviceError, Exit
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from tacdata.recording.check.report import Report

HELP = "docs/how_to/foreign_data.md"
CONTACT = {"contact/z", "contact/x, y"}
"""Unknown values that are the place of the skin in the machine, and none of the sensor."""
ORDER = 40
PANEL = RECORD
EXAMPLES = (
    "tacdata check session",
    "tacdata check session/episode-000003.mcap",
    "tacdata check session --json --out report",
)


def run(
    path: Annotated[Path, typer.Argument(help="A session folder or a recording (MCAP).")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for check.json and check.png; default: the session's.")
    ] = None,
) -> Result:
    """Check every stream for gaps, noise, stuck channels and missing tags; exit 0 if usable, 1 if not."""
    import tacdata as td

    try:
        report = checked(path, out or (path if path.is_dir() else path.parent))
    except DeviceError as error:
        if out is not None:
            raise
        # The recordings of a drive that may not be written are judged all the same.
        say(f"the report is not written: {error.given}; --out names another folder")
        report = td.check(path)
    if path.is_dir() and report.usable:
        # Labelling would refuse these recordings, so the missing keys are named here.
        if unknown := unknown_press(report):
            say(f"labels need more than the mapping says: give {unknown} there, and import again ({HELP})")
            suggest("browse", path)
        else:
            suggest("label", path)
    return Result(report.document, Exit.DONE if report.usable else Exit.UNFIT)


def unknown_press(report: Report) -> str:
    """Return the keys of a mapping without which labels of imported recordings are refused; "" if all are given."""
    rigs = [entry.recording.episode.rig.get("imported", {}) for entry in report.episodes]
    names = {text.split(":")[0] for rig in rigs for text in rig.get("stand_ins", [])}
    keys = {
        "sensor: FILE": {name for name in names if "/" in name or name in ("contact", "map")} - CONTACT,
        "indenter": names & {"indenter"},
        "contact": names & CONTACT,
    }
    return " and ".join(key for key, unknown in keys.items() if unknown)


def checked(path: Path, folder: Path) -> Report:
    """Check a recording or session, print the findings, and write them to a folder, with a picture."""
    import tacdata as td
    from tacdata import documents
    from tacdata.viewers.pictures.check import draw

    report = td.check(path)
    stem = "check" if path.is_dir() else f"{path.stem}.check"
    print(report.text, flush=True)  # even if other files fail
    documents.write(folder / f"{stem}.json", report.document, "check")
    if report.episodes:
        draw(report, folder / f"{stem}.png")
        print(f"picture: {folder / f'{stem}.png'}")
    return report
