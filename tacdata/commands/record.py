"""Press a sensor as a plan says and record every press."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import PIPELINE

if TYPE_CHECKING:
    from collections.abc import Callable

    from tacdata.plans import Press
    from tacdata.rig import Rig

ORDER = 10
PANEL = PIPELINE


def run(
    rig: Annotated[Path, typer.Option(help="Rig file: devices, registration, envelope.")],
    plan: Annotated[Path, typer.Option(help="Plan file: what to press.")],
    out: Annotated[Path, typer.Option(help="Session folder to create, or to continue with --resume.")],
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the next press not yet done.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the first move.")] = False,
) -> None:
    """Press the sensor as the plan says and record every press to its own MCAP file."""
    from tacdata.plans import read_plan
    from tacdata.recording.detection_process import in_background
    from tacdata.recording.preflight import Preflight
    from tacdata.recording.recorder import Recorder
    from tacdata.rig import read_rig
    from tacdata.sensor import default_sensor, read_sensor
    from tacdata.tags import detect_cube

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a stop from outside is a Ctrl-C
    bench, skin = read_rig(rig), read_sensor(sensor) if sensor else default_sensor()

    def confirm(summary: Preflight) -> bool:
        print(summary.text, flush=True)
        return yes or _answer("Move now? [y/N] ").lower() in ("y", "yes")

    with _Bar() as progress, in_background(detect_cube) as detect:
        recorder = Recorder(
            bench,
            skin,
            read_plan(plan),
            out,
            resume,
            mount=_mounting(bench),
            detect=detect,
            progress=progress,
        )
        try:
            session = recorder.run(confirm)
        except KeyboardInterrupt:
            kept = f"what was recorded is in {out}\n  next:    the same command with --resume"
            nothing = "nothing was moved or written"
            print(f"interrupted: motion stopped; {kept if out.exists() else nothing}", file=sys.stderr)
            raise typer.Exit(130) from None
    print(f"{len(session.done)} of {len(session.plan.presses)} presses recorded in {out}")
    print(f"next: tacdata check {out}")


def _answer(question: str) -> str:
    """Ask on the terminal; no answer (the input is closed) is an empty one."""
    try:
        return input(question).strip()
    except EOFError:
        print()
        return ""


def _mounting(rig: Rig) -> Callable[[Press], None]:
    """Return who mounts indenters: the virtual rig, or a person who is asked."""
    if "mounting" in rig.document:
        from tacdata.virtual_rig.mounting import mount

        return lambda press: mount(rig.document, press.indenter.document, press.yaw)

    def ask(press: Press) -> None:
        from tacdata.errors import UsageError

        sizes = ", ".join(f"{k} {v:g}" for k, v in press.indenter.document.items() if k != "shape")
        print(f"\nMount {press.indenter_name} ({press.indenter.shape}; {sizes}) at {press.yaw:g} deg.")
        if _answer("Mounted, and its tip zeroed? [y/N] ").lower() not in ("y", "yes"):
            raise UsageError(
                f"{press.indenter_name} was not mounted",
                "yes",
                "continue later with --resume; nothing is lost",
            )

    return ask


class _Bar:
    """A progress bar with the time left, or a line per press where there is no terminal."""

    def __enter__(self) -> Callable[[int, int, float], None]:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        columns = (
            TextColumn("recording"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]} left"),
        )
        self._progress = Progress(*columns) if sys.stdout.isatty() else None
        self._task = None
        return self._show

    def _show(self, done: int, wanted: int, seconds: float) -> None:
        left = f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
        if self._progress is None:
            print(f"  press {done} of {wanted} recorded, {left} left", flush=True)
            return
        if self._task is None:
            # Begun with the first press, so that no question to the person is painted over.
            self._progress.start()
            self._task = self._progress.add_task("", total=wanted, left=left)
        self._progress.update(self._task, completed=done, left=left)

    def __exit__(self, *exception: object) -> None:
        if self._progress:
            self._progress.stop()
