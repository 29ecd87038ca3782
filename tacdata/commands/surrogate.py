"""Solve a session's presses by finite elements into a table that answers at once."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import FIND, Result
from tacdata.errors import UsageError
from tacdata.progress import say, suggest

ORDER = 30
PANEL = FIND
EXAMPLES = (
    "tacdata surrogate session --dry-run --out base",
    "tacdata surrogate session --out base",
    "tacdata surrogate session --fine --out base",
)


def run(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings (.mcap) or session folders.")],
    out: Annotated[Path, typer.Option(help="New folder for spec.json and response.npz.")],
    spacing: Annotated[
        float | None, typer.Option(min=0.2, help="Distance of places [mm]; 0.8 where presses ship, else 1.6.")
    ] = None,
    fine: Annotated[bool, typer.Option("--fine", help="The default mesh, though its presses must be solved.")] = False,
    left_out: Annotated[
        int | None, typer.Option(min=0, help="Presses left out to measure the table's error; 3 where it is solved.")
    ] = None,
    device: Annotated[str, typer.Option(help="cpu, or a card: cuda:0.")] = "cpu",
    capacity: Annotated[int, typer.Option(min=1, help="Presses in work at a time; about 100 on a card.")] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what it takes and stop.")] = False,
) -> Result:
    """Solve the presses of a session by finite elements: the base of tacdata discrepancy --spec."""
    from tacdata.skin.mesh.build import MeshSettings
    from tacdata.stages import clock_face
    from tacdata.surrogate import TableSettings, work, written_spec
    from tacdata.surrogate.pressed import pressed

    if out.exists():
        raise UsageError(f"{out} exists", "a new folder; nothing is overwritten", "choose another --out")
    console = progress.console()
    with console.status("reading") as status:
        what = pressed(recordings)
        status.update("building the skin model")
        settings = TableSettings(spacing, MeshSettings() if fine else None, device, capacity, left_out)
        ready = work(what.sensor, what.reaches, settings)
    mesh = ready.model.settings.mesh
    # Presses that ship, or were solved for another session, are not solved again.
    missing = len(ready.missing)
    print(
        f"{ready.presses} presses of {', '.join(ready.names)} on {len(ready.model.mesh.nodes)} nodes "
        f"(edges of {mesh.outer:g} mm outside), {missing} of them to solve"
        + (f", about {clock_face(ready.expected_seconds)} on one core" if missing else "")
    )
    figures = {"presses": ready.presses, "to_solve": missing, "seconds": ready.expected_seconds if missing else 0.0}
    if dry_run:
        return Result(figures)
    with console.status("solving") as status:

        def show_press(done: int, of: int, seconds: float) -> None:
            status.update(f"press {done} of {of}, about {clock_face(seconds)} left")
            if not console.is_terminal and done:
                say(f"  press {done} of {of}, about {clock_face(seconds)} left")

        table, error = ready.done(show_press)
    if error:
        print(
            f"{error.presses} presses left out: loads off by {100 * error.load:.1f} % rms, "
            f"{100 * error.worst:.1f} % at most of a press's largest; forces by {100 * error.normal:.1f} %"
        )
    outside = table.uncovered(what.places)
    if outside:
        print(
            f"{len(outside)} presses lie where the model cannot be pressed (over a bonded rim), continued from beside"
        )
    spec = written_spec(out, ready, table, error)
    print(f"written: {spec}")
    suggest("discrepancy", *recordings, "--spec", spec, "--out VERDICT")
    return Result({**figures, "left_out": error, "uncovered": len(outside), "spec": spec})
