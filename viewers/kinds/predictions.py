"""Predictions of a network, without its input data."""

from pathlib import Path

from tacdata.errors import TacdataError, UsageError
from tacdata.sensor import Sensor
from tacdata.viewers.kinds.kind import Kind, refuse
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

CHECKPOINT = "best.safetensors"


class PredictionsKind(Kind):
    """A training run with predictions, their folder, or one file of it."""

    ORDER, NOUN = 25, "a training run or predictions"

    def claims(self, path: Path) -> bool:
        """A folder with a checkpoint, or files that `tacdata evaluate` wrote."""
        import pyarrow.parquet as pq

        from tacdata.training.inference.prediction import HEADER
        from tacdata.viewers.parts.prediction_files import PATTERN

        if (path / CHECKPOINT).is_file():
            return True
        file = next(path.glob(PATTERN), None) if path.is_dir() else path
        if file is None or file.suffix != ".parquet":
            return False
        try:
            return HEADER in (pq.read_schema(file).metadata or {})
        except Exception:  # a damaged file is of no kind; its reader raises the error
            return False

    def scene(self, path: Path, options: Asked) -> Scene:
        """Return one episode's predicted maps, the first if none is named."""
        from tacdata.training.inference.prediction import file_name, read_prediction
        from tacdata.viewers.parts.prediction_files import prediction_paths
        from tacdata.viewers.scenes.prediction import prediction_scene

        refuse(options, "predictions", "episode")
        files = [path] if path.is_file() else prediction_paths(path)
        source = files[0]
        if options.episode is not None:
            named = {file.name: file for file in files}
            if file_name(options.episode) not in named:
                numbers = ", ".join(str(int(file.stem.rsplit("-", 1)[-1])) for file in files[:20])
                raise UsageError(f"--episode {options.episode}: no prediction in {path}", numbers, "choose one of them")
            source = named[file_name(options.episode)]
        prediction = read_prediction(source)
        sensor = _sensor(path, prediction.sensor)
        title = f"{source.resolve().parents[1].name}/{source.stem}"
        return prediction_scene(title, prediction, sensor, len(files))


def _sensor(path: Path, digest: str) -> Sensor | None:
    """Return the sensor that the network was trained for, if its checkpoint is in the folder of its predictions."""
    for folder in (path, *path.resolve().parents[:2]):
        if (folder / CHECKPOINT).is_file():
            from tacdata.training.inference.checkpoint import load

            try:
                sensor = load(folder).sensor
            except TacdataError:
                return None
            # A network of another sensor has another grid: its axes would be wrong.
            return sensor if sensor.content_hash == digest else None
    return None
