"""Write the labelled recordings of a session as a LeRobot dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import PIPELINE, Result
from tacdata.progress import say, suggest

ORDER = 40
PANEL = PIPELINE


def run(
    session: Annotated[Path, typer.Argument(help="Folder of recordings, from `tacdata record`.")],
    out: Annotated[Path, typer.Option(help="Folder of the dataset; must not exist, unless --append.")],
    labels: Annotated[Path | None, typer.Option(help="Folder of labels; without it SESSION/labels.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Add to the dataset what it does not hold.")] = False,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file of the labels, if not the recorded one.")] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(help="Column of the labels to carry along, such as uncertainty (mm a pixel); give it repeatedly."),
    ] = None,
    model: Annotated[str | None, typer.Option(help="Content hash of the skin model to insist on.")] = None,
) -> Result:
    """Write the recordings and their labels as a LeRobot v3 dataset."""
    from tacdata.dataset.flags import carry_flags
    from tacdata.dataset.format.features import asked_for
    from tacdata.dataset.notes import carry_notes
    from tacdata.dataset.pack import LabelFiles, pack, refuse_existing
    from tacdata.labels import file_names
    from tacdata.recording.files.reader import read_episode
    from tacdata.recording.session import read_session
    from tacdata.sensor import read_sensor

    extra = asked_for(column or [])
    refuse_existing(out, append)
    found = read_session(session)
    files = LabelFiles(labels or file_names.folder(session))
    skin = read_sensor(sensor) if sensor else None
    files.check(found.episodes, skin, model)
    episodes = (read_episode(path) for path in found.episodes)

    def done(episode, reason: str) -> None:
        say(f"  {episode.path.name}  " + (f"left out: {reason}" if reason else "packed"))

    packed = pack(episodes, files, out, append=append, sensor=skin, model=model, extra=extra, done=done)
    for name, _ in packed.left_out:
        why = files.failure(session / name)
        if why:
            print(f"  {name} has no label because: {why}")
    for path in found.unfinished:
        print(f"  {path.name}  left out: the recording was broken off")
    for flag in carry_flags(session, out):
        print(f"  {flag.file}  set aside, training leaves it out: {flag.reason}")
    if carried := carry_notes(session, out):
        print(f"  {carried} notes on stretches carried along")
    print(f"{packed.episodes} episodes, {packed.frames} frames in {out}")
    suggest("train", out)
    return Result(packed)
