"""An evaluation on disk: scores.json, scores.md and scores.png, and one prediction file an episode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tacdata import documents, provenance
from tacdata.errors import UsageError
from tacdata.training.frames.frames import Frames
from tacdata.training.inference.prediction import PredictedMaps, file_name, write_prediction
from tacdata.training.reports.score_picture import draw
from tacdata.training.reports.score_sheet import markdown
from tacdata.training.scoring.evaluate import Evaluation

JSON, SHEET, PICTURE = "scores.json", "scores.md", "scores.png"


@dataclass(frozen=True)
class EvaluationPaths:
    """Where an evaluation goes."""

    scores: Path
    """Folder of the three score files."""
    predictions: Path
    """Folder of the prediction files."""

    def check(self) -> None:
        """Refuse to overwrite scores.

        Raises:
            UsageError: If there are scores in the folder already.
        """
        existing = [name for name in (JSON, SHEET, PICTURE) if (self.scores / name).exists()]
        if existing:
            raise UsageError(
                f"{self.scores} already holds {', '.join(existing)}",
                "a folder without scores",
                "choose another --out, or move these away",
            )


def places(run: Path, out: Path | None) -> EvaluationPaths:
    """Return where a run's evaluation goes: RUN/scores and RUN/predictions, or OUT and OUT/predictions."""
    folder = run if run.is_dir() else run.parent
    return (
        EvaluationPaths(folder / "scores", folder / "predictions")
        if out is None
        else EvaluationPaths(out, out / "predictions")
    )


def write(
    place: EvaluationPaths,
    evaluation: Evaluation,
    frames: Frames,
    listener: Callable[[int, int], None] = lambda k, n: None,
) -> None:
    """Write an evaluation: predictions first, scores.json last, so that scores never stand without them.

    Raises:
        UsageError: If there are scores in the folder already.
    """
    place.check()
    document = evaluation.document
    parents = {
        "checkpoint": evaluation.checkpoint_hash,
        "dataset": frames.dataset_hash,
        "sensor": frames.sensor.content_hash,
    }
    for count, result in enumerate(evaluation.episodes, start=1):
        span = result.span
        prediction = PredictedMaps(
            episode=span.number,
            time_ns=frames.time_ns[span.start : span.stop],
            depth=result.depth,
            part=evaluation.part,
            checkpoint=evaluation.checkpoint_hash,
            network=document["checkpoint"]["name"],
            dataset=frames.dataset_hash,
            sensor=frames.sensor.content_hash,
            provenance=provenance.stamp("training.scoring.evaluate", parents, {}),
        )
        write_prediction(place.predictions / file_name(span.number), prediction)
        listener(count, len(evaluation.episodes))
    documents.write_text(place.scores / SHEET, markdown(document))
    draw(place.scores / PICTURE, evaluation, frames)
    documents.write(place.scores / JSON, document, "scores")
