"""Try a demonstration's targets in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import TOOLS

ORDER = 123
PANEL = TOOLS


def run(
    path: Annotated[Path, typer.Argument(help="A recorded grasp that tacdata track worked up with a network.")],
    task: Annotated[str | None, typer.Option(help="Task whose gains are taken; default: the demonstration's.")] = None,
    gains: Annotated[Path | None, typer.Option(help="Gains file (YAML); default: the paper's.")] = None,
    seeds: Annotated[int, typer.Option(min=1, max=10000, help="Trials of each kind, a world of its own each.")] = 40,
    radius: Annotated[float, typer.Option(help="Radius of the ball [mm].")] = 35.0,
    mass: Annotated[float, typer.Option(help="Mass of the ball [kg].")] = 0.18,
    stiffness: Annotated[float, typer.Option(help="Of the springs that hold the robot's fingertips [N/m].")] = 300.0,
    out: Annotated[Path | None, typer.Option(help="File for the result (JSON).")] = None,
    view: Annotated[Path | None, typer.Option(help="Rerun file (.rrd): both replays of the undisturbed world.")] = None,
    find_gain: Annotated[
        float | None, typer.Option(metavar="MM", help="Find the smallest gain that presses every skin so deep.")
    ] = None,
) -> None:
    """Replay a demonstrated grasp directly and compensated on a ball in MuJoCo, over many seeds."""
    from tacdata import documents
    from tacdata.demonstrations.compensation import read_gains
    from tacdata.demonstrations.tracks_file import ENDING, path_of, read_tracks
    from tacdata.errors import UsageError
    from tacdata.replay.scene import Scene
    from tacdata.replay.trials import Trials
    from training.wilson import interval

    for file in (out, view):
        if file is not None and file.exists():
            raise UsageError(f"{file} exists", "a new file", "choose another name")
    made = read_tracks(path if path.name.endswith(ENDING) else path_of(path))
    if not 1 <= radius <= 200 or not 0 < mass <= 10 or not 1 <= stiffness <= 1e5:
        given = f"a ball of {radius:g} mm, {mass:g} kg; springs of {stiffness:g} N/m"
        raise UsageError(given, "1 to 200 mm, up to 10 kg, 1 to 100000 N/m", "correct them")
    scene = Scene(radius=radius / 1000, mass=mass, stiffness=stiffness)
    trials = Trials(made, read_gains(gains).of(task or made.task), scene)
    if find_gain is not None:
        print(f"the smallest gain for {find_gain:g} mm is {trials.smallest_gain(find_gain):.4f} m/mm for every finger")
        return
    if view is not None:
        from viewers.replay_view import save_replays

        shown = {kind: trials.one(kind, scene) for kind in ("direct", "compensated")}
        save_replays(view, shown, scene.radius)
        for kind, outcome in shown.items():
            forces = ", ".join(f"{name} {force:.2f} N" for name, force in outcome.force.items())
            print(f"undisturbed, {kind}: {'held' if outcome.held else 'lost'} ({forces})")
        print(f"saved {view}; look at it with: tacdata view {view}")
    document = trials.run(seeds, interval)
    for kind in ("direct", "compensated"):
        found = document[kind]
        low, high = found["wilson_95"]
        print(f"{kind:<12} held {found['held']} of {found['of']} ({low:.0%} to {high:.0%}, Wilson 95 %)")
    if out is not None:
        documents.write(out, document, "replay_result")
        print(f"written to {out}")
