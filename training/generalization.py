"""Trains and scores one recipe on several splits and seeds of one dataset."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from tacdata.errors import FormatError, UsageError
from tacdata.training.frames.frames import Frames
from tacdata.training.inference import checkpoint
from tacdata.training.reports import report
from tacdata.training.scoring.evaluate import Evaluation, evaluate
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import divide
from tacdata.training.train import Progress, train

DEFAULTS = ("episode", "configuration", "indenter", "site", "depth", "rate", "specimen")
"""Every way to hold presses out."""


@dataclass(frozen=True)
class SplitOutcome:
    """The scores of one split and seed, or why there are none."""

    settings: TrainingSettings
    folder: Path
    evaluation: Evaluation | None
    """Scores on the test episodes; None if the split is not possible."""
    reason: str = ""
    """Why it is not possible."""


def run_name(settings: TrainingSettings) -> str:
    """Return the folder of a run: network, split, seed."""
    return f"{settings.network}-{settings.split}-{settings.seed}"


def generalize(
    frames: Frames,
    recipe: TrainingSettings,
    splits: tuple[str, ...],
    seeds: int,
    out: Path,
    device: str = "auto",
    threads: int | None = None,
    begun: Callable[[TrainingSettings], Callable[[Progress], None]] = lambda settings: lambda progress: None,
) -> list[SplitOutcome]:
    """Train and score ``recipe`` on every split and seed; finished runs in ``out`` are kept, others continue.

    Args:
        frames: The dataset.
        recipe: Settings; split and seed are replaced.
        splits: Names of splits.
        seeds: How many seeds, from that of the recipe.
        out: Folder of the runs.
        device: As of `train`.
        threads: As of `train`.
        begun: Called before each run; returns the listener of its progress.

    Raises:
        UsageError: If a split does not exist, or no split is possible.
    """
    outcomes = []
    for split in splits:
        for seed in range(recipe.seed, recipe.seed + seeds):
            settings = replace(recipe, split=split, seed=seed)
            folder = out / run_name(settings)
            try:
                divide(frames, split, seed)
            except FormatError as error:
                outcomes.append(SplitOutcome(settings, folder, None, error.given))
                continue
            except UsageError as error:
                # Only a split that leaves a part without episodes is passed over; other errors are the user's to mend.
                if "leaves no" not in error.given:
                    raise
                outcomes.append(SplitOutcome(settings, folder, None, error.given))
                continue
            outcomes.append(
                SplitOutcome(settings, folder, _finished(frames, settings, folder, device, threads, begun(settings)))
            )
    if not any(outcome.evaluation for outcome in outcomes):
        raise UsageError(
            f"none of the splits {', '.join(splits)} is possible: {outcomes[0].reason}",
            "a dataset that can be divided",
            "record more, or choose other splits",
        )
    return outcomes


def _finished(
    frames: Frames,
    settings: TrainingSettings,
    folder: Path,
    device: str,
    threads: int | None,
    listener: Callable[[Progress], None],
) -> Evaluation:
    last = folder / checkpoint.LAST
    trained = train(frames, settings, folder, device, last.is_file(), threads, listener)
    evaluation = evaluate(trained, frames, device, threads)
    place = report.places(folder, None)
    if not (place.scores / report.JSON).exists():
        report.write(place, evaluation, frames)
    return evaluation
