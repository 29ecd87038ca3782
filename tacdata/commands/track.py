"""Work up recorded demonstrations."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.errors import UsageError
from tacdata.progress import say, suggest

if TYPE_CHECKING:
    from tacdata.demonstrations.demonstration import Demonstration
    from tacdata.demonstrations.paths.estimator import Estimator

ORDER = 10
PANEL = HANDS
EXAMPLES = (
    "tacdata track demos",
    "tacdata track demos --network shipped",
    "tacdata track demos --network thumb=thumb_network --rate 60",
)


def run(
    path: Annotated[Path, typer.Argument(help="A folder that record --demo wrote, or one of its recordings.")],
    network: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[FINGER=]RUN",
            help="A training run, a checkpoint or `shipped`: its predicted depth is added, marked as such. With "
            "FINGER= for one fingertip, each of which is a unit of its own.",
        ),
    ] = None,
    every_image: Annotated[
        bool,
        typer.Option("--every-image", help="Search all stored images for tags, not those that record had time for."),
    ] = False,
    rate: Annotated[float, typer.Option(help="Rate of the grid [Hz].")] = 30.0,
) -> Result:
    """Smooth the fingertip paths of demonstrations, mark gaps, name faults, and add a network's predicted depth."""
    from tacdata.demonstrations.compensation import contact_depth
    from tacdata.demonstrations.paths.second_look import look_again
    from tacdata.demonstrations.paths.tracking import UNSEARCHED, track
    from tacdata.demonstrations.paths.tracks_file import path_of, read_tracks, write_tracks
    from tacdata.demonstrations.recording.reader import read_demo
    from tacdata.demonstrations.recording.session import read_demo_session

    if not path.exists():
        raise UsageError(f"no {path}", "a folder that record --demo wrote, or one of its recordings", "check the path")
    recordings = read_demo_session(path).episodes if path.is_dir() else (path,)
    if not recordings:
        raise UsageError(f"no finished demonstration in {path}", "one or more", "record with tacdata record --demo")
    estimators = _estimators(network or [])
    summary = []
    for recording in recordings:
        read = read_demo(recording)
        # The recorder searches only the images that it has time for; --every-image searches those that it passed over.
        demonstration = track(look_again(read, _told) if every_image else read, rate, estimators)
        tracks_path = path_of(recording)
        if not estimators and tracks_path.is_file() and (lost := read_tracks(tracks_path).network):
            print(f"note: {tracks_path.name} held depth predicted by {lost['hash'][:12]}; without --network it goes")
        write_tracks(tracks_path, demonstration)
        _draw(demonstration, recording)
        length = f"{demonstration.seconds[-1]:.1f} s in frame {demonstration.frame!r}"
        print(f"{recording.name}: {length}, written to {path_of(recording).name}")
        for name, finger_track in demonstration.tracks.items():
            felt = ""
            if finger_track.depth is not None:
                depth = contact_depth(finger_track.depth)
                felt = f", predicted depth up to {max(depth[depth == depth], default=0.0):.2f} mm"
            print(
                f"  {name:<8} {finger_track.sightings} sightings, {finger_track.outliers} left out, "
                f"{finger_track.gap.mean():.1%} of the time in gaps{felt}"
            )
        summary.append(
            {
                "recording": recording.name,
                "frame": demonstration.frame,
                "seconds": demonstration.seconds[-1],
                "remarks": demonstration.remarks,
                "fingers": {
                    name: {"sightings": t.sightings, "left_out": t.outliers, "gap": t.gap.mean()}
                    for name, t in demonstration.tracks.items()
                },
            }
        )
        for remark in demonstration.remarks:
            print(f"  note: {remark}")
    if any(words.startswith(UNSEARCHED) for entry in summary for words in entry["remarks"]) and not every_image:
        named = " ".join(f"--network {words}" for words in network or [])
        suggest("track", path, f"{named} --every-image".strip())
        return Result({"recordings": summary})
    hint = "" if network else "  (with --network the targets can be compensated)"
    suggest("export", path, "--out EXPORT", hint)
    return Result({"recordings": summary})


def _told(done: int) -> None:
    if done % 100 == 0:
        say(f"{done} images searched for tags")


def _draw(demonstration: Demonstration, recording: Path) -> None:
    import numpy as np

    from tacdata.demonstrations.compensation import contact_depth
    from tacdata.viewers.pictures.tracks import Strip, draw_tracks

    strips = [
        Strip(
            name,
            finger_track.position,
            np.sqrt(np.trace(finger_track.covariance[:, 3:, 3:], axis1=1, axis2=2) / 3),
            finger_track.gap,
            None if finger_track.depth is None else contact_depth(finger_track.depth),
        )
        for name, finger_track in demonstration.tracks.items()
    ]
    title = f"{recording.name}: {demonstration.task}, frame {demonstration.frame!r}"
    draw_tracks(recording.with_suffix(".tracks.png"), demonstration.seconds, strips, title)


def _estimators(options: list[str]) -> dict[str, Estimator]:
    """Read the networks that --network names: finger -> estimator, `ALL` for one without finger."""
    from tacdata.demonstrations.paths.estimator import ALL

    estimators: dict[str, Estimator] = {}
    for words in options:
        finger, equals, run = words.partition("=")
        finger, run = (finger, run) if equals and not Path(words).exists() else (ALL, words)
        if finger in estimators:
            which = f"finger {finger}" if finger else "all fingers"
            raise UsageError(f"two networks for {which}", "one each", "leave one --network out")
        estimators[finger] = _estimator(run)
    return estimators


def _estimator(run: str) -> Estimator:
    from tacdata.demonstrations.paths.estimator import Estimator
    from tacdata.training.inference.sequence import identity, sequence_maps
    from tacdata.training.metrics import novelty
    from tacdata.training.pretraining.shipped import pretrained, unfitted

    trained = pretrained(run)
    readings = novelty.read(trained.path.parent, trained.content_hash)
    maps, words = partial(sequence_maps, trained), unfitted(trained)
    who = identity(trained) | ({"unfitted": words} if words else {})
    return Estimator(who, trained.sensor, maps, readings.novelty if readings else None)
