"""Compute the labels of a session with the FEM skin model."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.errors import SolveError
from tacdata.progress import StageBars, say, suggest

if TYPE_CHECKING:
    from tacdata.label_farm.labelling import LabellingSummary

ORDER = 40
PANEL = DATA
EXAMPLES = (
    "tacdata label session",
    "tacdata label session --no-uncertainty --workers 2",
    "tacdata label session --follow --into dataset",
)

PAUSE = 10.0
"""Time between two lines about kernels where there is no terminal [s]."""


def run(
    session: Annotated[Path, typer.Argument(help="Folder that `tacdata record` wrote.")],
    sensor: Annotated[Path | None, typer.Option(help="Sensor file, if not each recording's own.")] = None,
    store: Annotated[
        Path | None, typer.Option(help="Folder of solved presses, may serve many sessions; else SESSION/labels/store.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for labels of a session that may not be written; gets links to it.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Worker processes; else one per core or GPU.")] = None,
    redo: Annotated[
        bool, typer.Option("--redo", help="Replace labels of another model version; retry failed presses.")
    ] = False,
    follow: Annotated[
        bool, typer.Option("--follow", help="Begin while `tacdata record` adds presses; end with its plan.")
    ] = False,
    load_step: Annotated[float, typer.Option(help="Largest depth step while loading [mm].")] = 0.25,
    unload_step: Annotated[float, typer.Option(help="Depth step up [mm]; a skin on a board needs few.")] = 0.75,
    uncertainty: Annotated[
        bool,
        typer.Option(help="Say what the spreads that the sensor file states make of pixels; costs two thirds more."),
    ] = True,
    tolerance: Annotated[
        float,
        typer.Option(min=0.0, help="Add states where maps between them would be off by more [mm], or by 1 %; 0: none."),
    ] = 0.005,
    into: Annotated[
        Path | None, typer.Option(help="Dataset that each label flows into as soon as it is finished; made if missing.")
    ] = None,
    device: Annotated[
        list[str] | None, typer.Option(help="What workers solve on: cpu, cuda for all GPUs, cuda:0, ...; repeatable.")
    ] = None,
    dask: Annotated[
        str, typer.Option(help="Solve on a Dask cluster: tcp://HOST:PORT of its scheduler, or `here` to start one.")
    ] = "",
    alone: Annotated[
        bool, typer.Option("--alone", help="Same bits whatever is labelled with a press; costs twice as much; CPU.")
    ] = False,
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> Result:
    """Compute depth maps for every frame of a session; stopped and run again, it goes on."""
    import tacdata as td
    from tacdata.label_farm.environment import idle_gpus
    from tacdata.labels import file_names

    if hint := "" if dask else idle_gpus(device or ()):
        say(hint)
    with StageBars(PAUSE, each_press=True) as bars:
        summary = td.label(
            session,
            sensor=sensor,
            store=store,
            out=out,
            workers=workers,
            devices=device or (),
            redo=redo,
            follow=follow,
            load_step=load_step,
            unload_step=unload_step,
            tolerance=tolerance,
            uncertainty=uncertainty,
            into=into,
            dask=dask,
            alone=alone,
            factory=factory,
            progress=bars.show,
        )
    if follow and (remaining := len(td.read_session(session).remaining)):
        say(f"{remaining} presses of the plan were not recorded: label again when they are")
    return _report(summary, file_names.folder(out or session), out or session)


def _report(summary: LabellingSummary, labels: Path, session: Path) -> Result:
    import statistics

    for remark in summary.remarks:
        print(f"warning: {remark}", file=sys.stderr)
    print(
        f"labels written: {len(summary.written)} ({summary.untouched} without contact), "
        f"already there: {len(summary.current)}, failed: {len(summary.failed)}"
    )
    if summary.found:
        print(f"presses taken from the store: {summary.found}")
    if summary.seconds:
        # Presses go in fours, and the first of a model waits for it: so only the mean is the cost of one.
        mean = statistics.fmean(summary.seconds)
        print(f"presses solved: {len(summary.seconds)}, {mean:.0f} s of a worker each, on average")
    _report_margins(summary)
    for episode, reason in sorted(summary.failed.items()):
        print(f"episode {episode}: no label: {reason.splitlines()[0]}")
    print(f"labels lie in {labels}")
    if summary.failed:
        count = len(summary.failed) + len(summary.written) + len(summary.current)
        remedies = {reason.partition("next:")[2].strip() for reason in summary.failed.values()}
        # One remedy for all failures is worth printing; of several, the files name each.
        same = remedies.pop() if len(remedies) == 1 else ""
        error = SolveError(
            f"{len(summary.failed)} of {count} episodes have no label",
            "a label for every episode",
            same or f"read {labels}/episode-*.failure.json; `tacdata label {session} --redo` tries again",
        )
        return Result(summary, error)
    suggest("pack", session, "--out DATASET")
    return Result(summary)


def _report_margins(summary: LabellingSummary) -> None:
    """Say how well the labels are known."""
    from statistics import median

    margins = summary.margins
    if not margins:
        return
    uncertainties = [margin.uncertainty for margin in margins if margin.uncertainty is not None]
    numerical, between = (median(getattr(margin, name) for margin in margins) for name in ("numerical", "between"))
    spread = f"± {median(uncertainties):.4f} mm" if uncertainties else "not known, none stated or asked for"
    print(f"medians inside contact: numerical error ± {numerical:.4f} mm; by the sensor file's spreads: {spread}")
    print(f"largest error of a state that is left out: {between:.4f} mm, median of the labels")
    if 0 < len(uncertainties) < len(margins):
        print(f"{len(margins) - len(uncertainties)} labels have no spread: the reason is in their provenance")
