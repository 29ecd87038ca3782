"""A trained network that predicts the depth maps of an episode."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.display import Displayed
from tacdata.errors import UsageError
from tacdata.paths import StrPath
from tacdata.recording.episode import Episode
from tacdata.recording.files.reader import read_episode
from tacdata.sensor import Sensor
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.training.inference.sequence import sequence_maps
from tacdata.training.pretraining.shipped import pretrained, unfitted


@dataclass(frozen=True, repr=False)
class TrainedNetwork(Displayed):
    """A trained network."""

    checkpoint: Checkpoint
    """Weights and document."""

    @property
    def name(self) -> str:
        """Name of its architecture, a file in `training/networks`."""
        return self.checkpoint.network.name

    @property
    def sensor(self) -> Sensor:
        """The sensor that it was trained for."""
        return self.checkpoint.sensor

    @property
    def path(self) -> Path:
        """The checkpoint file."""
        return self.checkpoint.path

    def __fspath__(self) -> str:
        """Return the checkpoint file: functions that take a path take the object, too."""
        return str(self.path)

    @property
    def training_folder(self) -> Path:
        """The folder of the dataset that it was trained on.

        Raises:
            UsageError: If it is not there.
        """
        recorded = Path(self.checkpoint.document["dataset"]["path"])
        if not recorded.is_dir():
            raise UsageError(
                f"the dataset {recorded} of {self.path} is not there", "a dataset folder", "give --dataset"
            )
        return recorded

    def predict(self, episode: Episode | StrPath) -> PredictedMaps:
        """Return the depth map of each reading of an episode, or of the recording at a path.

        Raises:
            UsageError: If there is no recording.
            FormatError: If the episode is of another sensor, or cannot be tared.
        """
        trained = self.checkpoint
        episode = episode if isinstance(episode, Episode) else read_episode(episode)
        trained.check_sensor(episode.sensor, str(episode.path))
        identity = trained.content_hash
        return PredictedMaps(
            episode=episode.number,
            time_ns=episode.taxels.sample_ns,
            depth=self.maps(episode.tared),
            part="other dataset",
            checkpoint=identity,
            network=self.name,
            dataset="",
            sensor=episode.sensor.content_hash,
            provenance=provenance.stamp("TrainedNetwork.predict", {"checkpoint": identity}, {}),
        )

    def maps(self, readings: np.ndarray) -> np.ndarray:
        """Return depth maps [mm], shape (n, pixels_x, pixels_y), of tared readings [counts], shape (n, taxels).

        Raises:
            FormatError: If the readings are of another number of taxels, or hold values that are no numbers.
        """
        return sequence_maps(self.checkpoint, readings)

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: architecture, sensor, training."""
        document = self.checkpoint.document
        yield f"Network {self.name} ({self.path})"
        yield f"sensor {self.sensor.name}, window of {len(self.checkpoint.network.offsets)} readings"
        yield f"epoch {document['epoch']}, validation loss {document['best']['validation_loss']:.3g}"
        if remark := unfitted(self.checkpoint):
            yield remark.split(":")[0]


def read_network(path: StrPath) -> TrainedNetwork:
    """Read a trained network: a run's folder, a checkpoint file, or "shipped" for the one that ships.

    Raises:
        UsageError: If there is none.
        FormatError: If it is damaged or of another version.

    Example:
        >>> import tacdata as td
        >>> network = td.read_network("shipped")
        >>> network.predict(td.read_episode("session/episode-000000.mcap")).depth.shape
        (170, 35, 26)
    """
    return TrainedNetwork(pretrained(os.fspath(path)))
