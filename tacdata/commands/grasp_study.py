"""Run the study of contact-position-aware grasping."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import HANDS, Result
from tacdata.errors import UsageError
from tacdata.progress import say

if TYPE_CHECKING:
    from tacdata.grasping.lessons import Lesson
    from tacdata.sensor import Sensor
    from tacdata.training.frames.frames import Frames

ORDER = 50
PANEL = HANDS
EXAMPLES = (
    "tacdata grasp-study --out study",
    "tacdata grasp-study --network network --out study",
    "tacdata grasp-study --repeats 3 --seed 1 --out study",
)
RESULT, PICTURE, NETWORK = "grasp_study.json", "grasp_study.png", "network"


def run(
    out: Annotated[Path, typer.Option(help="Folder for the result; made if it does not exist.")],
    network: Annotated[
        Path | None, typer.Option(help="A run trained for this fingertip; default: one is trained in OUT/network.")
    ] = None,
    epochs: Annotated[int, typer.Option(min=1, help="Passes of that training.")] = 12,
    repeats: Annotated[int, typer.Option(min=1, max=200, help="Trials at each place with each strategy.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Decides every draw: oranges, fingertips, noise, weights.")] = 0,
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads of the training.")] = None,
) -> Result:
    """Grasp an orange at eight places by three strategies, through the skin model and a trained network.

    A network is trained on solved presses of other spheres and ellipsoids. Every trial goes through readings alone.
    """
    from tacdata import documents
    from tacdata.grasping import picture, result
    from tacdata.grasping.fingertip import fingertip_sensor
    from tacdata.grasping.press_set import FOLDER, read_presses
    from tacdata.grasping.study import Setup
    from tacdata.training.inference import checkpoint
    from tacdata.training.inference.sequence import identity, sequence_maps

    for name in (RESULT, PICTURE):
        if (out / name).exists():
            raise UsageError(f"{out / name} exists", "a new folder", "choose another --out")
    sensor = fingertip_sensor()
    trained = checkpoint.load(network or _trained(sensor, out / NETWORK, epochs, seed, threads))
    trained.check_sensor(sensor, "the study's fingertip")
    study = result.result(
        Setup(repeats=repeats, seed=seed),
        read_presses(FOLDER / "orange.npz", sensor),
        sensor,
        lambda readings: sequence_maps(trained, readings),
        identity(trained),
        _told,
    )
    documents.write(out / RESULT, study, "grasp_study")
    picture.save(study, out / PICTURE)
    print("\n".join(result.lines(study)))
    print(f"written to {out / RESULT} and {out / PICTURE}")
    return Result(study)


def _told(done: int, of: int) -> None:
    if done % 20 == 0:
        say(f"{done} of {of} trials")


def _trained(sensor: Sensor, run: Path, epochs: int, seed: int, threads: int | None) -> Path:
    """Train the paper's network on the shipped presses, or go on where that was broken off; return its folder."""
    from tacdata import provenance
    from tacdata.grasping.lessons import lessons
    from tacdata.grasping.press_set import FOLDER, read_presses
    from tacdata.grasping.touch import FingertipSpread
    from tacdata.training.settings import TrainingSettings
    from tacdata.training.train import Progress, train

    path = FOLDER / "training.npz"
    origin = provenance.content_hash([provenance.file_hash(path), seed])
    frames = _frames(lessons(read_presses(path, sensor), sensor, FingertipSpread(), seed), sensor, origin)

    def show_epoch(progress: Progress) -> None:
        if (line := progress.finished) is not None:
            say(f"epoch {progress.epoch} of {progress.epochs}: validation loss {line['validation_loss']:.5f}")

    begun = (run / "last.safetensors").is_file()
    train(frames, TrainingSettings(seed=seed, epochs=epochs), run, "auto", begun, threads, show_epoch)
    return run


def _frames(lessons: list[Lesson], sensor: Sensor, origin: str) -> Frames:
    import numpy as np

    from tacdata.training.frames.frames import EpisodeSpan, Frames

    ends = np.cumsum([len(lesson.taxels) for lesson in lessons]).tolist()
    spans = []
    for number, (lesson, stop) in enumerate(zip(lessons, ends, strict=True)):
        x, y, depth = lesson.tip[int(lesson.tip[:, 2].argmax())].tolist()
        start = stop - len(lesson.taxels)
        spans.append(EpisodeSpan(number, start, stop, lesson.indenter, lesson.shape, x=x, y=y, depth=depth))
    taxels, maps, tip = (np.concatenate([getattr(v, n) for v in lessons]) for n in ("taxels", "depth", "tip"))
    count = len(taxels)
    times = (np.arange(count) * 1e9 / sensor.taxels.rate).astype(np.int64)
    return Frames(
        taxels,
        maps,
        tip,
        np.full(count, -1),
        times,
        np.ones(count, dtype=bool),
        tuple(spans),
        sensor,
        origin,
        "presses that ship with tacdata.grasping",
        True,
    )
