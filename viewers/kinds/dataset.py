"""A dataset folder."""

from pathlib import Path

import numpy as np

from tacdata.errors import UsageError
from tacdata.viewers.kinds.kind import Kind
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

MARK = Path("meta/info.json")


class DatasetKind(Kind):
    """An episode of a dataset that `tacdata pack` wrote."""

    ORDER, NOUN = 40, "a dataset folder"

    def claims(self, path: Path) -> bool:
        """A LeRobot folder."""
        return (path / MARK).is_file()

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return one episode, the first if none is named."""
        from tacdata.dataset.format import features
        from tacdata.viewers.parts.stretch_notes import with_stretch_notes
        from tacdata.viewers.scenes.dataset import dataset_scene
        from tacdata.viewers.scenes.recording import prediction_for
        from tacdata.viewers.scenes.single_episode import read_single

        if options.labels is not None:
            raise UsageError("--labels with a dataset", "a dataset holds its labels", "leave it out")
        number = options.episode or 0
        if options.episode is None and options.predictions is not None:
            # Networks are asked about test episodes, and the first of a dataset is seldom one.
            number = _predicted(path, options.predictions)
        dataset, count = read_single(path, number)
        prediction, remarks = None, []
        entry = next((candidate for candidate in dataset.episodes if candidate.index == number), None)
        if options.predictions is not None and entry is not None:
            time = np.asarray(dataset[features.TIME][entry.start : entry.stop])
            prediction, remarks = prediction_for(options.predictions, time, entry.sensor)
        scene = dataset_scene(dataset, number, prediction, tuple(remarks), count)
        record = entry.record if entry is not None else None
        return scene if record is None else with_stretch_notes(scene, path, lambda: record.recording)


def _predicted(path: Path, predictions: Path) -> int:
    """Return the first episode of which there is a prediction; else the first of all."""
    from tacdata.dataset.format import features
    from tacdata.viewers.parts.prediction_files import first_predicted, prediction_paths
    from tacdata.viewers.scenes.single_episode import read_single

    for file in prediction_paths(predictions):  # named by the episode of the dataset that was predicted
        number = int(file.stem.rsplit("-", 1)[-1])
        dataset, _ = read_single(path, number)
        for entry in (candidate for candidate in dataset.episodes if candidate.index == number):
            time = np.asarray(dataset[features.TIME][entry.start : entry.stop])
            if first_predicted(predictions, [(number, int(time[0]), int(time[-1]))]) is not None:
                return number
    return 0
