"""Say how a unit is over its visits: gains, drift, noise, wiring, and whether to recalibrate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import Exit, UsageError
from tacdata.progress import say

if TYPE_CHECKING:
    from tacdata.health.network_error import NetworkError
    from tacdata.health.visit import Visit

ORDER = 60
PANEL = RECORD
EXAMPLES = (
    "tacdata health monday tuesday --out health",
    "tacdata health monday tuesday --model network",
    "tacdata health monday --json",
)


def run(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION...", help="Sessions of one unit, one a visit, in any order.")
    ],
    model: Annotated[
        Path | None, typer.Option(help="Trained network (a run or checkpoint): by how much its error has grown.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for health.html and health.json; default: the latest session's.")
    ] = None,
) -> Result:
    """Compare a unit's visits: gains, drift, dead or swapped channels, noise, hysteresis; exit 1 if it needs care.

    Record the plan that `tacdata plan health` writes at each visit. Name the first visit after a calibration, too.
    """
    from tacdata import documents
    from tacdata.health.advice import FIRST, NOTHING
    from tacdata.health.document import document, text
    from tacdata.health.history import history, in_order
    from tacdata.health.page import page
    from tacdata.health.visit import read_visit

    visits = []
    for folder in sessions:
        visits.append(read_visit(folder))
        say(f"read {folder}")
    visits = in_order(visits)  # before a network is asked
    network = _network_errors(model, visits) if model else {}
    report = history(visits, network)
    written = document(report)
    print(text(report), flush=True)  # whatever becomes of the files
    place = out or report.last.session.folder
    documents.write(place / "health.json", written, "health")
    documents.write_text(place / "health.html", page(report))
    print(f"page: {place / 'health.html'}")
    well = written["advice"][0]["do"] in (NOTHING, FIRST)
    return Result(written, Exit.DONE if well else Exit.UNFIT)


def _network_errors(model: Path, visits: list[Visit]) -> dict[str, NetworkError]:
    """Return a network's errors at the visits that are labelled, by the session's folder."""
    from tempfile import TemporaryDirectory

    import numpy as np

    from tacdata.dataset import pack
    from tacdata.health.network_error import NetworkError
    from tacdata.labels import file_names, read_label
    from tacdata.training.frames.data import read_frames
    from tacdata.training.inference import checkpoint
    from tacdata.training.scoring.evaluate import evaluate

    trained = checkpoint.load(model)
    labelled = [visit for visit in visits if file_names.present(file_names.folder(visit.session.folder))]
    if not labelled:
        raise UsageError(
            f"--model {model} with sessions without labels",
            "labelled sessions: a network's error is against labels",
            "run `tacdata label` on each, or leave --model out",
        )
    results = {}
    for visit in labelled:
        present = file_names.present(file_names.folder(visit.session.folder))
        episodes = [entry.recording.episode for entry in visit.entries]
        # Next to the session: a dataset of maps may not fit into the system's temporary folder.
        with TemporaryDirectory(dir=visit.session.folder.parent, prefix=".health-") as folder:
            members = [e for e in episodes if e.number in present]
            packed = pack(members, lambda e, paths=present: read_label(paths[e.number]), Path(folder) / "dataset")
            unpacked = {name for name, _ in packed.left_out}
            numbers = [e.number for e in members if e.path.name not in unpacked]
            scored = evaluate(trained, read_frames(packed.root))
            errors = {
                number: float(np.nanmean(scores.contact_rmse[result.valid & scores.labelled]))
                for number, result in zip(numbers, scored.episodes, strict=True)
                if ((scores := result.scores).labelled & result.valid).any()
            }
        results[str(visit.session.folder)] = NetworkError(trained.content_hash, errors)
        say(f"scored {visit.session.folder}")
    return results
