"""Try a demonstration's targets in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.commands.export import tracks_of
from tacdata.errors import UsageError

if TYPE_CHECKING:
    from tacdata.demonstrations.demonstration import Demonstration
    from tacdata.replay.comparison.trials import Trials
    from tacdata.replay.scene import ReplayScene

ORDER = 30
PANEL = HANDS
EXAMPLES = (
    "tacdata replay demos",
    "tacdata replay demos/episode-000000.mcap --seeds 20 --out replay.json",
    "tacdata replay demos --robot examples/two_finger_hand/robot.yaml",
)


def run(
    paths: Annotated[list[Path], typer.Argument(help="Recordings that tacdata track worked up with a network.")],
    task: Annotated[str | None, typer.Option(help="Task whose gains are taken; default: the demonstration's.")] = None,
    gains: Annotated[Path | None, typer.Option(help="Gains file (YAML); default: the paper's.")] = None,
    seeds: Annotated[int, typer.Option(min=1, max=10000, help="Trials of each kind, a world of its own each.")] = 40,
    thing: Annotated[
        str | None,
        typer.Option(
            "--object", help="ball, can, box, eraser, or an object file (.yaml); default: eraser to wipe, else ball."
        ),
    ] = None,
    radius: Annotated[
        float | None, typer.Option(help="Half the object's width between the fingers, a ball's radius [mm].")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Of the object [kg]; default: the object's own.")] = None,
    stiffness: Annotated[float, typer.Option(help="Of the springs that hold the robot's fingertips [N/m].")] = 300.0,
    out: Annotated[Path | None, typer.Option(help="File for the result (JSON).")] = None,
    view: Annotated[Path | None, typer.Option(help="Rerun file (.rrd): the first one's replays, undisturbed.")] = None,
    video: Annotated[Path | None, typer.Option(help="The same as a film (.mp4 or .gif).")] = None,
    find_gain: Annotated[
        bool, typer.Option("--find-gain", help="Find the smallest gain that holds the object in preliminary trials.")
    ] = False,
    gain_from: Annotated[
        Path | None, typer.Option(help="With --find-gain: find it on this recording, and try it on the others.")
    ] = None,
    preliminary: Annotated[int, typer.Option(min=1, max=1000, help="Preliminary trials of --find-gain.")] = 20,
    most_slip: Annotated[
        float, typer.Option(metavar="MM", help="With --find-gain: how far the object may slide along a pad.")
    ] = 3.0,
    most_force: Annotated[float, typer.Option(metavar="N", help="With --find-gain: the largest force on a pad.")] = 6.0,
    least_grip: Annotated[
        float, typer.Option(help="With --find-gain: how many times the load friction at the pads must carry.")
    ] = 2.0,
    stiffnesses: Annotated[
        bool, typer.Option("--sweep", help="All arms at springs of 150 to 3000 N/m as well.")
    ] = False,
    challenges: Annotated[
        bool,
        typer.Option("--challenges", help="All arms, and depth fed back, in scenes unlike the demonstration as well."),
    ] = False,
    robot: Annotated[
        Path | None, typer.Option(help="Robot file: its joints follow the targets, in place of pads without links.")
    ] = None,
    with_guesses: Annotated[
        bool, typer.Option("--with-guesses", help="Let targets pass that bridge gaps and are known badly.")
    ] = False,
) -> Result:
    """Replay demonstrated grasps or wipes, direct and compensated, in MuJoCo, over seeds."""
    from tacdata import documents
    from tacdata.demonstrations.compensation import read_gains
    from tacdata.demonstrations.paths.tracks_file import read_tracks
    from tacdata.replay.comparison.gain_search import GripDemand
    from tacdata.replay.comparison.trials import Trials, challenged, result, sweep
    from tacdata.replay.robot import read_robot
    from tacdata.replay.scene import read_object, scene_of
    from tacdata.replay.targets import check_guesses, doubts

    for file in (out, view, video):
        if file is not None and file.exists():
            raise UsageError(f"{file} exists", "a new file", "choose another name")
    if gain_from is not None and not find_gain:
        raise UsageError("--gain-from without --find-gain", "both or none", "add --find-gain")
    for option, value, lower, upper, unit in (
        ("radius", radius, 1, 200, "mm"),
        ("mass", mass, 0.001, 10, "kg"),
        ("stiffness", stiffness, 1, 1e5, "N/m"),
        ("most-slip", most_slip, 0.1, 100, "mm"),
        ("most-force", most_force, 0.1, 1000, "N"),
        ("least-grip", least_grip, 0.1, 100, "times the load"),
    ):
        if value is not None and not lower <= value <= upper:
            raise UsageError(f"--{option} {value:g}", f"{lower:g} to {upper:g} {unit}", "correct it")
    demonstrations = [read_tracks(tracks_of(path)) for path in paths]
    source = read_tracks(tracks_of(gain_from)) if gain_from is not None else demonstrations[0]
    names = {task or demonstration.task for demonstration in (*demonstrations, source)}
    if len(names) > 1:
        raise UsageError(f"recordings of the tasks {', '.join(sorted(names))}", "one task", "replay each task alone")
    # A gain that is found and tried on one recording says nothing about others.
    by_hash = {demonstration.recording_hash: demonstration for demonstration in demonstrations}
    if gain_from is not None and source.recording_hash in by_hash:
        raise UsageError(f"{gain_from} among those tried", "other recordings than that", "try others")
    name = names.pop()
    own: dict[str, Any] = {"name": thing}
    place = None
    if thing is not None and Path(thing).suffix in (".yaml", ".yml", ".json"):
        own, place = read_object(Path(thing), {demonstration.frame for demonstration in (source, *demonstrations)})
    own |= {"stiffness": stiffness} if mass is None else {"stiffness": stiffness, "mass": mass}
    scene = scene_of(name, width=None if radius is None else radius / 1000, **own)
    # Without a robot the pads follow the targets themselves.
    hand = None if robot is None else read_robot(robot)
    gain_sets, gain = {"compensated": read_gains(gains).of(name)}, None
    # Before the search: these remarks may explain its failure.
    for demonstration in ({source.recording_hash: source} | by_hash).values():
        untouched = Trials(demonstration, {}, scene, hand, place)
        original = untouched.seen
        if not with_guesses:
            check_guesses(original)
        for words in (
            *doubts(original),
            *demonstration.guesses(),
            *(_other_network(source, demonstration) if find_gain else ()),
        ):
            print(f"note: {demonstration.recording}: {words}")
        print(f"{demonstration.recording}: {untouched.place.text}")
    if find_gain:
        search = Trials(source, {}, scene, hand, place).find_gain(
            GripDemand(preliminary, most_slip / 1000, most_force, least_grip)
        )
        print(f"found on {source.recording}: {search.text}")
        gain, gain_sets["chosen"] = (source, search), dict.fromkeys(source.tracks, search.gain)
    tried = [Trials(demonstration, gain_sets, scene, hand, place) for demonstration in demonstrations]
    if view is not None or video is not None:
        _save(view, video, tried[0], scene)
    document = result(tried, seeds, scene, gain)
    rates = document["controls"] | document
    for kind in tried[0].paths:
        low, high = rates[kind]["wilson_95"]
        print(f"{kind:<12} held {rates[kind]['held']} of {rates[kind]['of']} ({low:.0%} to {high:.0%}, Wilson 95 %)")
    print(document["worth"])
    if stiffnesses:
        document["sweep"] = sweep(tried, scene, seeds)
        _print_rows(document["sweep"], "stiffness", name)
    if challenges:
        document["challenges"] = challenged(tried, scene, seeds)
        _print_rows(document["challenges"], "challenge", name)
    if out is not None:
        documents.write(out, document, "replay_result")
        print(f"written to {out}")
    return Result(document)


def _print_rows(rows: list[dict[str, Any]], first: str, task: str) -> None:
    """Print the outcomes of each arm, a row for each stiffness or challenge, and the benefit of depth there."""
    from tacdata.replay.comparison.trials import PUBLISHED, like_published

    widths = {kind: max(len(kind), 11) for kind in rows[0]["rates"]}
    print("\n" + "  ".join([f"{first:<24}", *(f"{kind:>{width}}" for kind, width in widths.items())]))
    for row in rows:
        name = f"{row[first]:g} N/m" if first == "stiffness" else row[first]
        mark = " *" if first == "stiffness" and like_published(row, task) else ""
        cells = (f"{rate['held']:>4} of {rate['of']:<4}".rjust(widths[kind]) for kind, rate in row["rates"].items())
        print("  ".join([f"{name + mark:<24}", *cells]))
    for row in rows:
        print(f"{row[first]:g} N/m: {row['worth']}" if first == "stiffness" else f"{row[first]}: {row['worth']}")
    if first == "stiffness":
        direct, touch = PUBLISHED.get(task, (0.0, 0.0))
        print(
            f"* as often as in the paper (Exp. 2): direct {direct:.0%}, compensated {touch:.0%}; the stiffness of its "
            "hand, a LinkerHand O20, is not published"
        )


def _other_network(source: Demonstration, demonstration: Demonstration) -> tuple[str, ...]:
    """Note that a gain was found with another network than the one that predicted a demonstration's depth."""
    theirs, ours = ((entry.network or {}).get("hash", "") for entry in (source, demonstration))
    if theirs == ours:
        return ()
    return (
        f"its depth is predicted by checkpoint {ours[:12]}, the gain is found with {theirs[:12]}: a gain makes up for "
        "the errors of one network on one unit, so find it with the same",
    )


def _save(view: Path | None, video: Path | None, tried: Trials, scene: ReplayScene) -> None:
    """Write the undisturbed replays of one recording, and print their verdicts."""
    from tacdata.viewers.pictures.replay_film import film_replays
    from tacdata.viewers.rerun.replay import save_replays

    scenes = {kind: tried.one(kind, scene) for kind in tried.paths}
    if view is not None:
        save_replays(view, scenes, tried.seen)
    if video is not None:
        film_replays(video, scenes, tried.seen)
    for kind, outcome in scenes.items():
        forces = ", ".join(f"{name} {force:.2f} N" for name, force in outcome.force.items())
        print(f"undisturbed, {kind}: {outcome.reason} ({forces})")
    if view is not None:
        print(f"saved {view}; look at it with: tacdata view {view}")
    if video is not None:
        print(f"saved {video}")
