"""Run the whole pipeline once against a virtual rig, through the verbs that a lab would type."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from tacdata import stages
from tacdata.commands.command import TOOLS, Result
from tacdata.errors import SolveError, UsageError

ORDER = 100
PANEL = TOOLS
START_LIMIT = 60.0
"""Time that the virtual rig may take to open its ports [s]."""


def run(
    out: Annotated[Path, typer.Option(help="Folder to make; if it exists, a numbered one beside it.")] = Path("demo"),
    presses: Annotated[int, typer.Option(min=8, help="Presses to record.")] = 96,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of the training over its frames.")] = 10,
    speed: Annotated[
        float, typer.Option(min=1.0, max=16.0, help="Virtual seconds per second; less on a busy machine.")
    ] = 4.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the plan, the virtual world and the training.")] = 1,
) -> Result:
    """Run the main job once against a virtual rig, in some eight minutes, and say where everything lies."""
    place = _Place(_new_folder(out))
    recording, learning = place.recording(presses, seed), place.learning(epochs, seed)
    kept = f"what was finished is in {place.folder}; on a busy machine run again with a lower --speed"
    line = stages.Line(len(recording) + len(learning) + 3, kept)
    begin = time.monotonic()
    try:
        with ExitStack() as stack:
            with stages.Background(place.virtual_rig(speed, seed), place.folder / "virtual-rig.log") as background:
                background.wait_until(place.rig.is_file, "a virtual rig that writes its rig file", START_LIMIT)
                for purpose, arguments in recording[:-1]:
                    line.run(purpose, arguments)
                # Recording is mostly waiting: labels are computed beside it, and it has the processor first.
                log = place.folder / "label.log"
                labelling = stack.enter_context(stages.Background(place.labelling(), log, yielding=True))
                line.run(*recording[-1])
            line.run("check what was recorded", ["check", str(place.session)])
            # A press that could not be solved has no label and is left out of the dataset; the others go on.
            line.join("label every frame by finite elements", labelling, tolerated=SolveError.exit_code)
        for purpose, arguments in learning:
            line.run(purpose, arguments)
        line.run(*place.viewing())
    except KeyboardInterrupt:
        print(f"\nstopped at stage {line.number}: what was finished is in {place.folder}", file=sys.stderr)
        raise
    took = time.monotonic() - begin
    print(f"\nthe whole job took {stages.clock_face(took)}; it left")
    for what, path in place.products.items():
        print(f"  {what:<14} {path}" + ("" if path.exists() else "   MISSING"))
    left = {what: path for what, path in place.products.items() if path.exists()}
    return Result({"folder": place.folder, "seconds": took, "left": left})


class _Place:
    """Where everything goes, and the arguments that put it there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rig, self.plan = folder / "rig" / "rig.yaml", folder / "plan.yaml"
        self.session, self.dataset, self.network = (folder / n for n in ("session", "dataset", "network"))
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

    def learning(self, epochs: int, seed: int) -> list[tuple[str, list[str]]]:
        session, dataset, network = str(self.session), str(self.dataset), str(self.network)
        train = ["train", dataset, "--from", "shipped", "--out", network, "--epochs", str(epochs), "--seed", str(seed)]
        return [
            ("pack recordings and labels as a LeRobot dataset", ["pack", session, "--out", dataset]),
            ("fit the network that ships to this sensor", train),
            ("score it on presses that it has not seen", ["evaluate", network]),
        ]

    def viewing(self) -> tuple[str, list[str]]:
        number = _telling_episode(self.dataset, self.network / "predictions")
        view = ["view", str(self.session), "--episode", str(number), "--predictions", str(self.network)]
        save = ["--save", str(self.scene), "--picture", str(self.picture)]
        return "draw the deepest press that the network had not seen", [*view, *save]

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


def _new_folder(wanted: Path) -> Path:
    """Make a folder that did not exist: the wanted one, or the first free of wanted-2, wanted-3, ..."""
    folder, number = wanted, 1
    while True:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
            folder = wanted.with_name(f"{wanted.name}-{number}")
            continue
        except OSError as error:
            raise UsageError(
                f"the folder {folder} cannot be made: {error.strerror}", "a place to write", "choose another --out"
            ) from None
        if number > 1:
            print(f"{wanted} exists and is left as it is; this run goes into {folder}")
        return folder


def _telling_episode(dataset: Path, predictions: Path) -> int:
    """Return the session's number of the deepest press for which there is a prediction."""
    from tacdata.dataset.reader import read_dataset

    episodes = read_dataset(dataset).episodes
    numbers = [int(path.stem.rsplit("-", 1)[-1]) for path in predictions.glob("episode-*.parquet")]
    presses = [press for number in numbers if (press := episodes[number].press)]
    return max(presses, key=lambda press: press.depth).index
