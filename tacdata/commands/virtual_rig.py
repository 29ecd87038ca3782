"""The verb ``tacdata virtual-rig``."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import RECORD
from tacdata.errors import UsageError

if TYPE_CHECKING:
    from tacdata.sensor import Sensor

ORDER = 5
PANEL = RECORD
NAMED = 1.0
"""Waits of the rig's clock that are named at its end [s, real time]."""
EXAMPLES = (
    "tacdata virtual-rig rig",
    "tacdata virtual-rig rig --rough --seed 3",
    "tacdata virtual-rig hands --demo --task wipe",
)


def run(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="where rig.yaml and truth.yaml are written")],
    speed: Annotated[
        float | None, typer.Option(help="seconds of the rig per real second; default 8, with --demo 0.5")
    ] = None,
    seed: Annotated[int, typer.Option(help="which world: registration error, gains, noise")] = 0,
    camera: Annotated[bool, typer.Option(help="with a camera that watches the AprilTag cube")] = True,
    sensor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[FINGER=]FILE",
            help="sensor file; default: the paper's. With --demo also one for each finger: --sensor thumb=FILE",
        ),
    ] = None,
    rough: Annotated[bool, typer.Option("--rough", help="sensor put down by eye, to be registered first")] = False,
    demo: Annotated[
        bool, typer.Option("--demo", help="a hand at a task, for record --demo: writes demo_rig.yaml")
    ] = False,
    cameras: Annotated[int, typer.Option(help="with --demo: cameras on the hand, 1 or 2")] = 2,
    task: Annotated[str, typer.Option(help="with --demo: grasp (a ball) or wipe (with an eraser)")] = "grasp",
    thing: Annotated[
        str | None, typer.Option("--object", help="with --demo: what is grasped: ball, can or box; default ball")
    ] = None,
    nub: Annotated[
        float | None,
        typer.Option(metavar="MM", help="with --demo: fingers press round nubs of this radius on ball or eraser"),
    ] = None,
    hide: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=SIZE",
            help="an effect that rig.yaml does not mention, for discrepancy to find: play=0.06, late=0.08, give=0.05",
        ),
    ] = None,
    fault: Annotated[
        str | None, typer.Option(help="with --demo: no-tag, turned-tag, swapped-fingers or silent-finger")
    ] = None,
) -> None:
    """Emulate a rig (GRBL, taxel board, camera) that other verbs reach by its rig.yaml, until Ctrl-C."""
    from tacdata.virtual_rig.rig import VirtualRig
    from tacdata.virtual_rig.world.hidden import hidden_from

    secret = hidden_from(hide or [])
    if secret and demo:
        raise UsageError("--hide with --demo", "one of them", "leave one out")
    if task != "grasp" and not demo:
        raise UsageError(f"--task {task} without --demo", "--demo --task wipe", "add --demo")
    if thing is not None and not demo:
        raise UsageError(f"--object {thing} without --demo", f"--demo --object {thing}", "add --demo")
    if nub is not None and not demo:
        raise UsageError(f"--nub {nub:g} without --demo", f"--demo --nub {nub:g}", "add --demo")
    # Handlers before the start: a signal that comes meanwhile must not leave ports and files behind.
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    skins = _skins(sensor or [], demo)
    if demo:
        from tacdata.virtual_rig.demo import VirtualDemo
        from tacdata.virtual_rig.world.hand import RADIUS

        rig = VirtualDemo(
            directory,
            0.5 if speed is None else speed,
            seed,
            cameras,
            fault,
            skins,
            task,
            RADIUS if nub is None else nub,
            thing,
        )
    else:
        rig = VirtualRig(directory, 8.0 if speed is None else speed, seed, camera, skins.get("thumb"), rough, secret)
    try:
        rig.start()
        lines = [*rig.emulates, f"rig file           {rig.path}"]
        if sensor and not demo:
            lines.append(f"sensor             {sensor[-1]}; give --sensor to register and record too")
        print("\n".join([*lines, "Ctrl-C stops it."]), flush=True)
        while not stopped.wait(0.5):
            pass
    finally:
        rig.stop()
    slow = (
        f"; this computer was too busy for --speed {rig.clock.rate:g}: the clock waited {rig.host.waited:.1f} s in all"
    )
    print("stopped" + slow * (rig.host.waited > NAMED), flush=True)


def _skins(options: list[str], demo: bool) -> dict[str, Sensor]:
    """Read the sensor files of --sensor: finger -> sensor. A file without finger is for all that are not named."""
    from tacdata.sensor import read_sensor
    from tacdata.virtual_rig.world.hand import DIRECTIONS

    skins: dict[str, Sensor] = {}
    for words in options:
        finger, equals, file = words.partition("=")
        finger, file = (finger, file) if equals and not Path(words).exists() else ("", words)
        if finger and not demo:
            raise UsageError(f"--sensor {words} without --demo", "--sensor FILE", "leave the finger out, or add --demo")
        if finger in skins:
            which = f"finger {finger}" if finger else "all fingers"
            raise UsageError(f"two sensors for {which}", "one each", "leave one --sensor out")
        skins[finger] = read_sensor(Path(file))
    # A file without a finger is for all fingers that have none of their own.
    default = skins.pop("", None)
    return skins if default is None else {**dict.fromkeys(DIRECTIONS, default), **skins}
