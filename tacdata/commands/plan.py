"""Write a press plan to train on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import TOOLS

ORDER = 101
PANEL = TOOLS


def run(
    out: Annotated[Path, typer.Option(help="Plan file to write (YAML); must not exist.")],
    presses: Annotated[int, typer.Option(min=1, help="How many presses.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same plan.")] = 0,
    indenter: Annotated[
        list[str] | None, typer.Option(help="Specimen to use; repeat for several. Default: the usual five.")
    ] = None,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
) -> None:
    """Write a press plan to train on: random sites, depths and speeds with several indenters."""
    from tacdata import documents
    from tacdata.errors import UsageError
    from tacdata.plans.training_plan import USUAL, training_plan
    from tacdata.sensor import default_sensor, read_sensor

    if out.exists():
        raise UsageError(f"{out} exists", "a new file; plans are not overwritten", "choose another --out")
    skin = read_sensor(sensor) if sensor else default_sensor()
    document = training_plan(skin, presses, seed, tuple(indenter) if indenter else USUAL)
    documents.write(out, document, "plan")
    print(f"{presses} presses with {', '.join(document['indenters'])} in {out}")
    print(f"next: tacdata record --rig RIG --plan {out} --out SESSION")
