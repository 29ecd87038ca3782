"""Press a sensor by a plan and record every press."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata import progress
from tacdata.commands.command import RECORD, Result, agreed, before_it_moves
from tacdata.errors import Exit, UsageError
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from collections.abc import Callable

    from tacdata.plans import Press
    from tacdata.rig import Rig

ORDER = 30
PANEL = RECORD
EXAMPLES = (
    "tacdata record --rig rig.yaml --plan plan.yaml --out session",
    "tacdata record --rig rig.yaml --plan plan.yaml --out session --resume",
    "tacdata record --demo --rig demo_rig.yaml --out demos --seconds 18",
)


def run(
    rig: Annotated[Path, typer.Option(help="Rig file: devices, registration, envelope.")],
    out: Annotated[Path, typer.Option(help="Session folder to create, or to continue with --resume.")],
    plan: Annotated[Path | None, typer.Option(help="Plan file: what to press.")] = None,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
    registration: Annotated[
        Path | None, typer.Option(help="Registration file; default: registration.yaml next to the rig file.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the next press not yet done.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the first move.")] = False,
    confirm_position: Annotated[
        str, typer.Option(metavar="CODE", help="Answer yes to one question about a lost position, by its code.")
    ] = "",
    sync_tap: Annotated[
        bool, typer.Option("--sync-tap", help="First touch a taxel a few times to measure the streams' delays.")
    ] = False,
    live: Annotated[
        str | None, typer.Option(metavar="WHERE", help="Watch in Rerun: window, web, or a file name (.rrd).")
    ] = None,
    demo: Annotated[
        bool, typer.Option("--demo", help="Record by hand, without a guide: boards on fingers, cameras on tag cubes.")
    ] = False,
    task: Annotated[str, typer.Option(help="With --demo: what is demonstrated, for example grasp.")] = "grasp",
    seconds: Annotated[
        float | None, typer.Option(help="With --demo: length of each; without it Enter or Ctrl-C ends one [s].")
    ] = None,
    demonstrations: Annotated[int, typer.Option(min=1, help="With --demo: how many.")] = 1,
) -> Result:
    """Press the sensor by the plan and record every press to its own MCAP file; or --demo, by hand."""
    if demo:
        # The demo rig names sensors and cameras itself: a plan or a sensor file would silently do nothing.
        unwanted = {"--plan": plan, "--sensor": sensor, "--registration": registration, "--live": live}
        named = [k for k, v in unwanted.items() if v is not None]
        return _by_hand(rig, out, task, seconds, demonstrations, resume, named)
    if plan is None:
        raise UsageError("no --plan", "a plan file, or --demo", "make one with tacdata plan")
    with before_it_moves():
        from contextlib import nullcontext

        from tacdata.plans import read_plan
        from tacdata.recording.live.detection_process import in_background
        from tacdata.recording.live.interruption import Interruption
        from tacdata.recording.live.recorder_process import announced
        from tacdata.recording.motion.preflight import Preflight
        from tacdata.recording.recorder import Recorder
        from tacdata.registration.chosen import chosen_registration
        from tacdata.registration.evidence import prove_zero
        from tacdata.rig import read_rig
        from tacdata.sensor import default_sensor, read_sensor
        from tacdata.tags import look

        skin = read_sensor(sensor) if sensor else default_sensor()
        registered = chosen_registration(read_rig(rig), rig, registration, skin)
        bench = registered.rig

    # Asked after the devices answered and before anything moves.
    def confirm(summary: Preflight) -> bool:
        print(summary.text, flush=True)
        # On standard error, so that a pipe does not swallow them.
        print("\n".join(registered.warnings), file=sys.stderr, flush=True)
        return yes or agreed("Move now? [y/N] ")

    # The viewer is a process of its own: drawing must not delay the streams.
    if live:
        from tacdata.viewers.live.window import live_view

        view = live_view(live, skin.taxels.columns, skin.taxels.rows)
    else:
        view = nullcontext()
    bar = _Bar()
    with announced(out), Interruption() as interruption, view as watch, bar as show, in_background(look) as detect:
        recorder = Recorder(
            bench,
            skin,
            read_plan(plan),
            out,
            resume,
            mount=_mounting(bench, bar),
            detect=detect,
            progress=show,
            sync_tap=sync_tap,
            say=lambda words: say(f"  {words}"),
            watch=watch,
            interruption=interruption,
            ask=agreed,
            confirmed=confirm_position,
            prove=prove_zero,
        )
        try:
            session = recorder.run(confirm)
        except KeyboardInterrupt as error:
            print("\n".join(["interrupted", *getattr(error, "__notes__", ())]), file=sys.stderr)
            raise typer.Exit(Exit.INTERRUPTED) from None
        finally:
            # Kept however the recording ends: without the registration the recordings have no place on the skin.
            registered.keep(out)
    print(f"{len(session.done)} of {len(session.plan.presses)} presses recorded in {out}")
    suggest("check", out)
    return Result({"session": out, "recorded": len(session.done), "planned": len(session.plan.presses)})


def _by_hand(
    rig: Path, folder: Path, task: str, seconds: float | None, count: int, resume: bool, unwanted: list[str]
) -> Result:
    from tacdata.demonstrations.recording.by_hand import record_by_hand

    if unwanted:
        raise UsageError(f"--demo with {', '.join(unwanted)}", "--rig, --out, --task", "the demo rig names the sensors")
    try:
        session = record_by_hand(rig, folder, task, seconds, count, resume)
    except KeyboardInterrupt as error:
        print("\n".join(["interrupted", *getattr(error, "__notes__", ())]), file=sys.stderr)
        raise typer.Exit(Exit.INTERRUPTED) from None
    count = len(session.episodes)
    print(f"{count} demonstration{'' if count == 1 else 's'} in {folder}")
    suggest("track", folder)
    return Result({"session": folder, "demonstrations": [path.name for path in session.episodes]})


def _mounting(rig: Rig, bar: _Bar) -> Callable[[Press], None]:
    """Return who mounts indenters: the virtual rig, or a person who is asked."""
    if "mounting" in rig.document:
        from tacdata.virtual_rig.world.mounting import mount

        return lambda press: mount(rig.document, press.indenter.document, **press.angles)

    def ask(press: Press) -> None:
        bar.pause()
        sizes = ", ".join(f"{k} {v:g}" for k, v in press.indenter.document.items() if k != "shape")
        print(f"\nMount {press.indenter_name} ({press.indenter.shape}; {sizes}) at {press.turned}.")
        if not agreed("Mounted, and its tip zeroed? [y/N] "):
            raise UsageError(
                f"{press.indenter_name} was not mounted", "yes", "continue later with --resume; nothing is lost"
            )

    return ask


class _Bar:
    """A progress bar with the time left, counted down between presses, or a line per press without a terminal."""

    def __enter__(self) -> Callable[[int, int, float], None]:
        from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, TextColumn

        bar = self

        class TimeLeft(ProgressColumn):
            def render(self, task: object) -> str:
                return f"{bar.left()} left"

        columns = (TextColumn("recording"), BarColumn(), MofNCompleteColumn(), TimeLeft())
        self._progress = progress.bars(*columns) if sys.stdout.isatty() else None
        self._task = None
        self._seconds, self._since = 0.0, time.monotonic()
        return self._show

    def left(self) -> str:
        """Return the time left as minutes and seconds."""
        seconds = max(self._seconds - (time.monotonic() - self._since), 0.0)
        return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"

    def pause(self) -> None:
        """Take the bar away, so that a question to the person is not painted over."""
        if self._progress and self._task is not None:
            self._progress.stop()

    def _show(self, done: int, total: int, seconds: float) -> None:
        self._seconds, self._since = seconds, time.monotonic()
        if self._progress is None:
            say(f"  press {done} of {total} recorded, {self.left()} left")
            return
        if self._task is None:
            self._task = self._progress.add_task("", total=total)
        self._progress.start()
        self._progress.update(self._task, completed=done)

    def __exit__(self, *exception: object) -> None:
        if self._progress:
            self._progress.stop()
