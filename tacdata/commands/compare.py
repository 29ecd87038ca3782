"""Compare two label versions, two networks, or a model with measurements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.errors import UsageError

if TYPE_CHECKING:
    from tacdata.viewers.scene.scene import Scene

ORDER = 50
PANEL = DATA
EXAMPLES = (
    "tacdata compare session --labels relabelled --episode 3",
    "tacdata compare dataset --predictions network --predictions history",
    "tacdata compare session --spec before.json --spec after.json",
)


def run(
    path: Annotated[Path, typer.Argument(help="A session (labels, networks, models) or dataset (networks).")],
    labels: Annotated[
        list[Path] | None, typer.Option(help="Folders of labels, twice; once: against SESSION/labels.")
    ] = None,
    predictions: Annotated[
        list[Path] | None, typer.Option(help="Training runs or folders of predictions, twice.")
    ] = None,
    spec: Annotated[
        list[Path] | None, typer.Option(help="Model specs (.json), e.g. before and after an effect: against readings.")
    ] = None,
    episode: Annotated[int | None, typer.Option(min=0, help="Its number there; else the first.")] = None,
    save: Annotated[Path | None, typer.Option(help="Write a Rerun file (.rrd) instead of opening a window.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write one page (.png) instead of opening a window.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film (.mp4 or .gif) instead of opening a window.")] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve Rerun's web viewer on this machine.")] = False,
) -> Result:
    """Show two label versions, two networks, or models and measurement side by side and as difference."""
    from tacdata.viewers import comparison, showing

    output = showing.Output(save, picture, video, web)
    options = [name for name, value in (("labels", labels), ("predictions", predictions), ("spec", spec)) if value]
    if len(options) != 1:
        problem = "nothing to compare" if not options else "--" + " and --".join(options)
        raise UsageError(problem, "one of --labels, --predictions, --spec", "say what to compare")
    output.check()
    if labels:
        scene = comparison.labels_at(path, labels, episode)
    elif predictions:
        scene = comparison.predictions_at(path, predictions, episode)
    else:
        scene = _models(path, spec or [], episode)
    print("\n".join(scene.found))
    showing.show(scene, output)
    return Result({"compared": scene.title, "found": scene.found, "written": output.files})


def _models(path: Path, specs: list[Path], episode: int | None) -> Scene:
    from dataclasses import replace

    import numpy as np

    from tacdata.discrepancy.data.recordings import course_of
    from tacdata.discrepancy.model.spec import read_spec
    from tacdata.revision.comparison import Comparison
    from tacdata.viewers.comparison import array_of, telling_names
    from tacdata.viewers.scenes.comparison import readings_comparison

    # A response that is fitted needs every press, so all are read even where one is shown.
    course = course_of([path])
    recording = f"episode-{episode:06d}" if episode is not None else course.names[0]
    if recording not in course.names:
        raise UsageError(f"--episode {episode}: not in {path}", ", ".join(course.names), "choose one of them")
    rows = np.flatnonzero((course.episode == course.names.index(recording)) & (course.averaged > 0))
    measured, readings = course.readings[rows], {}
    models = {name: read_spec(file) for name, file in zip(telling_names(specs), specs, strict=True)}
    # One model alone shows the gap; with effects also what they contribute.
    if len(models) == 1:
        name, model = next(iter(models.items()))
        effects = " and ".join(entry["effect"] for entry in model.document["effects"])
        if effects:  # effects show in a comparison with the same model without them
            bare = replace(model, document={**model.document, "effects": []})
            models = {f"without {effects}": bare, f"with {effects}": model}
    for name, spec in models.items():
        comparison = Comparison(course, spec)
        prediction = comparison.predicted(comparison.before.response, [])[rows]
        # The offset of a press is no property of a model.
        readings[name] = prediction + (measured - prediction).mean(axis=0)
    time = np.round(1e9 * (course.time[rows] - course.time[rows[0]])).astype(np.int64)
    title = f"{path.resolve().name}/{recording}: model and measurement"
    shape, unit = array_of(path, course.channels)
    return readings_comparison(title, shape, time, measured, readings, unit)
