"""Say which episodes of a dataset are labelled by the current model."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

ORDER = 70


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset that labels flowed into, or `tacdata pack` wrote.")],
    build: Annotated[
        bool, typer.Option(help="Build the model of now to compare with; else the one that was asked for last.")
    ] = True,
    factory: Annotated[str, typer.Option(hidden=True, help="What builds the model: module:name.")] = "",
) -> None:
    """Say which episodes are complete, failed, waiting, or stale against the model of now."""
    from label_farm.model import FACTORY, version
    from tacdata.dataset import folder, label_states, metadata
    from tacdata.sensor import Sensor

    folder.read_info(dataset)
    sensors = (metadata.read_main(dataset) or {"sensors": {}})["sensors"]
    models = {}
    for key, document in sensors.items() if build else ():
        models[key] = version(factory or FACTORY, Sensor.from_document(document, str(dataset))).content_hash
    states = label_states.states(dataset, models)
    for entry in states:
        if entry.state != "complete":
            print(f"  {entry.recording}  {entry.state}" + (f": {entry.reason}" if entry.reason else ""))
    counted = Counter(entry.state for entry in states)
    print(", ".join(f"{counted[name]} {name}" for name in ("complete", "stale", "failed", "waiting")))
    if counted["stale"]:
        print("next: label the sessions again (--redo) into a new dataset; what did not change is not solved again")
