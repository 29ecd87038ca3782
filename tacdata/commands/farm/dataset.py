"""Say which episodes of a dataset are labelled by the current model."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.progress import say

ORDER = 70
EXAMPLES = (
    "tacdata farm dataset sets/skin",
    "tacdata farm dataset sets/skin --no-build",
    "tacdata farm dataset sets/skin --json",
)


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset that labels flowed into, or `tacdata pack` wrote.")],
    build: Annotated[
        bool, typer.Option(help="Build the model of now to compare with; else the one that was asked for last.")
    ] = True,
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> Result:
    """Say which episodes are complete, failed, waiting, or stale against the model of now."""
    from tacdata.dataset import label_states
    from tacdata.dataset.format import folder, metadata
    from tacdata.label_farm.presses.model import FACTORY, version
    from tacdata.sensor import Sensor

    folder.read_info(dataset)
    sensors = (metadata.read_main(dataset) or {"sensors": {}})["sensors"]
    models, present = {}, label_states.models_in(dataset)
    for key, document in sensors.items() if build else ():
        skin = Sensor.from_document(document, str(dataset))
        models[key] = version(factory or FACTORY, skin).content_hash
        if present.get(key) != models[key]:
            # Labels made with --no-uncertainty are of the same model without the sensor file's spreads.
            plain = version(factory or FACTORY, replace(skin, uncertainty={})).content_hash
            models[key] = plain if present.get(key) == plain else models[key]
    states = label_states.states(dataset, models)
    for entry in states:
        if entry.state != "complete":
            print(f"  {entry.recording}  {entry.state}" + (f": {entry.reason}" if entry.reason else ""))
    counted = Counter(entry.state for entry in states)
    print(", ".join(f"{counted[name]} {name}" for name in ("complete", "stale", "failed", "waiting")))
    if counted["stale"]:
        say("next: label the sessions again (--redo) into a new dataset; what did not change is not solved again")
    return Result({"episodes": states, "counts": counted})
