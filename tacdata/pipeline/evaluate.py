"""Scores of a network on a dataset."""

from collections.abc import Callable

from tacdata.dataset.reader import Dataset, read_dataset
from tacdata.paths import StrPath
from tacdata.pipeline.trained_network import TrainedNetwork, read_network
from tacdata.training.frames.data import frames_of
from tacdata.training.scoring.evaluate import Evaluation
from tacdata.training.scoring.evaluate import evaluate as score_network


def evaluate(
    network: TrainedNetwork | StrPath,
    dataset: Dataset | StrPath | None = None,
    *,
    device: str = "auto",
    threads: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Evaluation:
    """Score a network on the test episodes of its dataset, or on all episodes of another one.

    Args:
        network: The network, a run's folder or a checkpoint file.
        dataset: The dataset or its folder; None takes the one that the network was trained on.
        device: "auto", "cpu", "cuda" or "cuda:N".
        threads: CPU threads; None takes one a core, at most 4.
        progress: Called after each episode with the number done and the number of all.

    Returns:
        The scores: `document` (`schemas/scores.schema.json`) and the predicted maps of each episode.

    Raises:
        UsageError: If there is no network, or no dataset.
        FormatError: If the dataset is of another sensor, or lacks episodes of the split.
    """
    trained = network if isinstance(network, TrainedNetwork) else read_network(network)
    scored = dataset if isinstance(dataset, Dataset) else read_dataset(dataset or trained.training_folder)
    return score_network(trained.checkpoint, frames_of(scored), device, threads, progress)
