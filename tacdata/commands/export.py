"""Hand demonstrations to robots."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.errors import Exit

if TYPE_CHECKING:
    from tacdata.demonstrations.demonstration import Demonstration
    from tacdata.replay.targets import FingertipTargets

ORDER = 20
PANEL = HANDS
EXAMPLES = (
    "tacdata export demos --out targets --format lerobot",
    "tacdata export demos --out targets --format csv --direct",
    "tacdata export demos --out joints --format joints --robot robot.yaml",
)
SESSION = "session.json"
"""Content of a folder of recorded presses."""


def run(
    path: Annotated[
        Path, typer.Argument(help="A folder that tacdata track worked up, one of its recordings, or a session.")
    ],
    out: Annotated[Path, typer.Option(help="Folder to make.")],
    form: Annotated[
        str, typer.Option("--format", help="A file's name in tacdata/exporters: lerobot, csv, open_x_tactile, ...")
    ] = "lerobot",
    direct: Annotated[
        bool, typer.Option("--direct", help="Targets as the fingertips were seen, not moved by what was felt.")
    ] = False,
    task: Annotated[str | None, typer.Option(help="Task whose gains are taken; default: the demonstrations'.")] = None,
    gains: Annotated[Path | None, typer.Option(help="Gains file (YAML); default: the paper's grasp and wipe.")] = None,
    finger: Annotated[list[str] | None, typer.Option(help="Which fingers, in this order; default: all.")] = None,
    robot: Annotated[Path | None, typer.Option(help="Robot file (YAML), for --format joints.")] = None,
    with_guesses: Annotated[
        bool, typer.Option("--with-guesses", help="Let targets pass that bridge gaps and are known badly.")
    ] = False,
) -> Result:
    """Write fingertip targets, direct or compensated by touch, in a format that a robot reads."""
    from tacdata.demonstrations.compensation import read_gains
    from tacdata.demonstrations.paths.tracks_file import path_of, read_tracks
    from tacdata.demonstrations.recording.session import read_demo_session
    from tacdata.exporters.exporter import exporter
    from tacdata.replay.targets import check_guesses, doubts, targets_of

    writer = exporter(form, robot, path if path.is_dir() else path.parent)
    if (path / SESSION).is_file():
        demonstrations, direct = _presses(path), True
    else:
        files = [path_of(p) for p in read_demo_session(path).episodes] if path.is_dir() else [tracks_of(path)]
        demonstrations = map(read_tracks, files)
    episodes = []
    for demonstration in demonstrations:
        gain = None if direct else read_gains(gains).of(task or demonstration.task)
        episodes.append(targets_of(demonstration, gain, finger or ()))
        if not with_guesses:
            check_guesses(episodes[-1])
    limits = writer.write(episodes, out)
    for targets in episodes:
        shift = 1000 * abs(targets.position - targets.seen).max()
        kind = f"compensated by up to {shift:.1f} mm" if targets.kind == "compensated" else "direct"
        print(f"{targets.recording}: {len(targets.time_ns)} targets for {', '.join(targets.fingers)}, {kind}")
    for targets in episodes:
        for words in (*doubts(targets), *_notes(targets)):
            print(f"note: {targets.recording}: {words}")
    for table in writer.tables:
        print(table)
    for words in (*limits, *writer.remarks):
        print(f"note: {words}")
    print(f"written to {out} ({form}), poses in frame {episodes[0].frame!r}")
    summary = [
        {"recording": t.recording, "kind": t.kind, "targets": len(t.time_ns), "notes": _notes(t)} for t in episodes
    ]
    unfit = bool(limits) and writer.needs_robot
    result = {"targets": summary, "limits": limits, "remarks": writer.remarks, "folder": out}
    return Result(result, Exit.UNFIT if unfit else Exit.DONE)


def _presses(session: Path) -> Iterator[Demonstration]:
    """Read the presses of a session, one at a time: there the tip is commanded, and nothing is to be compensated."""
    from tacdata.recording.files.reader import read_episode
    from tacdata.recording.session import read_session
    from tacdata.replay.pressed import pressed

    for recording in read_session(session).episodes:
        yield pressed(read_episode(recording))


def _notes(targets: FingertipTargets) -> list[str]:
    """Return remarks on compensated targets: missing readings, and unknown quantities."""
    source = targets.source
    if source is None or targets.kind == "direct":
        return []
    return [words for words in targets.remarks if words not in source.remarks] + source.guesses(targets.fingers)


def tracks_of(path: Path) -> Path:
    """Return the tracks of a recording; a file of tracks is itself."""
    from tacdata.demonstrations.paths.tracks_file import ENDING, path_of

    return path if path.name.endswith(ENDING) else path_of(path)
