"""Find a network's prediction for an episode."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tacdata.errors import FormatError, UsageError
from tacdata.training.inference.prediction import PredictedMaps, read_prediction

PATTERN = "episode-*.parquet"


def find_prediction(folder: Path, time_ns: np.ndarray) -> PredictedMaps | None:
    """Return the prediction whose frames are those of an episode, or None if the folder holds none.

    A prediction is numbered by its dataset, a recording by its session; the frames' times show the match.

    Args:
        folder: Folder that `tacdata evaluate` wrote, or the training run that holds it as ``predictions``.
        time_ns: Sample times of the episode's frames [ns], shape (n,).

    Raises:
        UsageError: If there is no such folder or no prediction in it.
        FormatError: If a file is damaged.
    """
    paths = prediction_paths(folder)
    return next((read_prediction(path) for path in paths if np.isin(_times(path), time_ns).any()), None)


def first_predicted(folder: Path, spans: Iterable[tuple[int, int, int]]) -> int | None:
    """Return the first of some episodes of which a folder holds a prediction, or None.

    Args:
        folder: As in `find_prediction`.
        spans: Number, first and last time [ns] of each episode, in order.

    Raises:
        UsageError: If there is no such folder or no prediction in it.
        FormatError: If a file is damaged.
    """
    begins = np.array([_times(path)[0] for path in prediction_paths(folder)])
    return next((number for number, a, b in spans if ((begins >= a) & (begins <= b)).any()), None)


def prediction_paths(folder: Path) -> list[Path]:
    """Return the prediction files of a folder or training run, by name.

    Raises:
        UsageError: If there is no such folder or no prediction in it.
    """
    inner = folder / "predictions"
    folder = inner if inner.is_dir() else folder
    paths = sorted(folder.glob(PATTERN)) if folder.is_dir() else []
    if not paths:
        raise UsageError(
            f"no prediction in {folder}" if folder.is_dir() else f"no folder {folder}",
            "a folder of predictions, or a training run with one",
            "run `tacdata evaluate` first",
        )
    return paths


def _times(path: Path) -> np.ndarray:
    try:
        return pq.ParquetFile(path).read(columns=["time_ns"])["time_ns"].to_numpy()
    except (pa.ArrowException, OSError, KeyError) as error:
        raise FormatError(
            f"{path} is no readable prediction file: {str(error).splitlines()[0]}",
            "a file that `tacdata evaluate` wrote",
            "run `tacdata evaluate` again: predictions can always be made again",
        ) from None
