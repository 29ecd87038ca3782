"""Run the whole pipeline once against a virtual rig, through the verbs that a lab would type."""

from __future__ import annotations

import json
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from tacdata import stages
from tacdata.commands.command import START, Result
from tacdata.errors import SolveError, UsageError
from tacdata.extras import require
from tacdata.progress import say

ORDER = 20
PANEL = START
EXAMPLES = ("tacdata demo", "tacdata demo --presses 24 --epochs 5 --out small", "tacdata demo --seed 2 --out second")
EXTRAS = ("fem", "learn", "view")
START_LIMIT = 60.0
"""Time that the virtual rig may take to open its ports [s]."""


def run(
    out: Annotated[
        Path,
        typer.Option(help="Folder to make. A recorded demo in it goes on; next to any other, a numbered one is made."),
    ] = Path("demo"),
    presses: Annotated[int, typer.Option(min=8, help="Presses to record.")] = 96,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of the training over its frames.")] = 10,
    speed: Annotated[
        float, typer.Option(min=1.0, max=16.0, help="Virtual seconds per second; less on a busy machine.")
    ] = 4.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the plan, the virtual world and the training.")] = 1,
) -> Result:
    """Run the main job once against a virtual rig, in some eight minutes, and name every file that it leaves."""
    require(EXTRAS, "tacdata demo")
    recorded = _is_recorded(_Place(out))
    place = _Place(out if recorded else _new_folder(out))
    recording, learning = place.recording(presses, seed), place.learning(epochs, seed)
    remains = f"finished stages are in {place.folder}; `tacdata demo --out {place.folder}` goes on once all is recorded"
    line = stages.Line(len(recording) + len(learning) + 3, remains)
    begin = time.monotonic()
    try:
        if recorded:
            line.skip(len(recording) + 1, f"{place.session} is recorded: the demo goes on with its labels")
            line.run("label every frame by finite elements", place.labelling(), tolerated=SolveError.exit_code)
        else:
            _record(place, recording, line, speed, seed)
        for purpose, arguments, product in learning:
            if product.exists():
                line.skip(1, f"{product} exists")
            else:
                line.run(purpose, arguments)
        line.run(*place.viewing())
    except KeyboardInterrupt:
        print(f"\nstopped at stage {line.number}: {remains}", file=sys.stderr)
        raise
    duration = time.monotonic() - begin
    print(f"\nthe whole job took {stages.clock_face(duration)}; its products:")
    for product, path in place.products.items():
        print(f"  {product:<14} {path}" + ("" if path.exists() else "   MISSING"))
    print(_accuracy(place.scores))
    say(f"next: open {place.picture}, or `tacdata browse {place.session}`")
    products = {product: path for product, path in place.products.items() if path.exists()}
    return Result({"folder": place.folder, "seconds": duration, "left": products})


def _record(place: _Place, recording: list[tuple[str, list[str]]], line: stages.Line, speed: float, seed: int) -> None:
    """Record, check and label a session on a virtual rig."""
    with ExitStack() as stack:
        with stages.Background(place.virtual_rig(speed, seed), place.folder / "virtual-rig.log") as background:
            background.wait_until(place.rig.is_file, "a virtual rig that writes its rig file", START_LIMIT)
            for purpose, arguments in recording[:-1]:
                line.run(purpose, arguments)
            # Recording is mostly waiting, so labels are computed meanwhile; the recorder has priority.
            log = place.folder / "label.log"
            labelling = stack.enter_context(stages.Background(place.labelling(), log, yielding=True))
            # In the foreground: its progress is what a person watches.
            line.run(*recording[-1])
        line.run("check what was recorded", ["check", str(place.session)])
        # A press that could not be solved has no label and is left out of the dataset; the others go on.
        line.join("label every frame by finite elements", labelling, tolerated=SolveError.exit_code)


def _is_recorded(place: _Place) -> bool:
    """Return whether the folder holds a session with every press of its plan, and no finished demo."""
    from tacdata.recording.session import FILE, read_session

    return (place.session / FILE).is_file() and not place.picture.exists() and not read_session(place.session).remaining


def _accuracy(scores: Path) -> str:
    """Return the median errors on held-out presses as a sentence in millimetres."""
    document = json.loads(scores.read_text())
    table, pitch = document["contact_frames"], document["sensor"]["pixel_pitch_mm"]
    peak, region, place = (table[name]["median"] for name in ("peak_error", "contact_rmse", "centroid_error"))
    if None in (peak, region, place):
        return "no held-out frame is in contact: the network has no score"
    count = len(document["split"]["episodes"])
    return (
        f"on {count} press{'es' * (count != 1)} that the network had not seen, the median frame is right to "
        f"{peak:.2f} mm in peak depth, {region:.2f} mm over the contact and {place * pitch:.2f} mm in place"
    )


class _Place:
    """Where everything goes, and the arguments that put it there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rig, self.plan = folder / "rig" / "rig.yaml", folder / "plan.yaml"
        self.session, self.dataset, self.network = (folder / n for n in ("session", "dataset", "network"))
        self.scores = self.network / "scores" / "scores.json"
        self.scene, self.picture = folder / "episode.rrd", folder / "episode.png"

    def virtual_rig(self, speed: float, seed: int) -> list[str]:
        return ["virtual-rig", str(self.rig.parent), "--speed", f"{speed:g}", "--seed", str(seed)]

    def recording(self, presses: int, seed: int) -> list[tuple[str, list[str]]]:
        # One approach to a place and two taxels: enough for this, and half of the time.
        register = ["register", "--rig", str(self.rig), "--yes", "--repeats", "1", "--taxel", "7", "--taxel", "16"]
        plan = ["plan", "--presses", str(presses), "--seed", str(seed), "--out", str(self.plan)]
        record = ["record", "--rig", str(self.rig), "--plan", str(self.plan), "--out", str(self.session), "--yes"]
        return [
            ("find where the sensor lies, by touching it", register),
            ("make a press plan", plan),
            ("record every press of the plan", record),
        ]

    def labelling(self) -> list[str]:
        return ["label", str(self.session), "--follow", "--no-uncertainty"]

    def learning(self, epochs: int, seed: int) -> list[tuple[str, list[str], Path]]:
        """Return purpose, arguments and product of each stage after the labels."""
        session, dataset, network = str(self.session), str(self.dataset), str(self.network)
        train = ["train", dataset, "--from", "shipped", "--out", network, "--epochs", str(epochs), "--seed", str(seed)]
        if self.network.is_dir():
            # A training that was stopped left its folder, which a new run would refuse.
            train.append("--resume")
        packed = self.dataset / "meta" / "info.json"
        return [
            ("pack recordings and labels as a LeRobot dataset", ["pack", session, "--out", dataset], packed),
            ("fit the network that ships to this sensor", train, self.scores),
            ("score it on presses that it has not seen", ["evaluate", network], self.scores),
        ]

    def viewing(self) -> tuple[str, list[str]]:
        number = _telling_episode(self.dataset, self.network / "predictions")
        view = ["view", str(self.session), "--episode", str(number), "--predictions", str(self.network)]
        # A run that stopped between the two files leaves the scene, and nothing is overwritten.
        save = [] if self.scene.exists() else ["--save", str(self.scene)]
        return "draw the deepest press that the network had not seen", [*view, *save, "--picture", str(self.picture)]

    @property
    def products(self) -> dict[str, Path]:
        from tacdata.labels import file_names

        return {
            "recordings": self.session,
            "labels": file_names.folder(self.session),
            "dataset": self.dataset,
            "checkpoint": self.network / "best.safetensors",
            "score table": self.network / "scores" / "scores.md",
            "as a picture": self.network / "scores" / "scores.png",
            "Rerun file": self.scene,
            "one page of it": self.picture,
        }


def _new_folder(target: Path) -> Path:
    """Make a folder that did not exist: the wanted one, or the first free of wanted-2, wanted-3, ..."""
    folder, number = target, 1
    while True:
        try:
            folder.mkdir(parents=True)
        # Made and not only looked for: two demos that start together get different folders.
        except FileExistsError:
            number += 1
            folder = target.with_name(f"{target.name}-{number}")
            continue
        except OSError as error:
            raise UsageError(
                f"the folder {folder} cannot be made: {error.strerror}", "a place to write", "choose another --out"
            ) from None
        if number > 1:
            print(f"{target} exists and is left as it is; this run goes into {folder}")
        return folder


def _telling_episode(dataset: Path, predictions: Path) -> int:
    """Return the session's number of the deepest press for which there is a prediction."""
    from tacdata.dataset.reader import read_dataset

    episodes = read_dataset(dataset).episodes
    numbers = [int(path.stem.rsplit("-", 1)[-1]) for path in predictions.glob("episode-*.parquet")]
    presses = [press for number in numbers if (press := episodes[number].press)]
    return max(presses, key=lambda press: press.depth).index
