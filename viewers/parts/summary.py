"""Summary of an episode, as Markdown."""

from textwrap import wrap

import numpy as np

from tacdata.dataset.reader import Dataset, DatasetEpisode
from tacdata.labels import Label
from tacdata.plans import Press
from tacdata.recording.episode import Episode
from tacdata.sensor import Sensor
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.parts.label import ShownLabel
from tacdata.viewers.parts.prediction_error import press_error
from tacdata.viewers.scene.scene import CameraView, DepthMaps

LINE_LENGTH = 170
"""Characters that fit across a page."""


def of_press(press: Press) -> str:
    """Return the nominal configuration in one line."""
    sizes = ", ".join(f"{k} {v:g}" for k, v in press.indenter.document.items() if k != "shape")
    names = {"yaw": "yaw", "tilt_x": "leaning about x", "tilt_y": "about y"}
    rotation = "".join(f", {names[name]} {angle:g}°" for name, angle in press.angles.items() if angle)
    return (
        f"{press.indenter.shape} ({sizes}; mm, °) at x {press.x:g} mm, y {press.y:g} mm{rotation}, "
        f"depth {press.depth:g} mm, {press.speed:g} mm/s, held {press.hold:g} s"
    )


def of_sensor(sensor: Sensor) -> str:
    """Return the sensor in one line."""
    return f"- **Sensor** {sensor.name}, {sensor.taxels.columns} × {sensor.taxels.rows} taxels"


def of_episode(
    episode: Episode,
    label: Label | ShownLabel | None,
    prediction: PredictedMaps | None,
    maps: tuple[DepthMaps, ...],
    cameras: tuple[CameraView, ...],
    remarks: tuple[str, ...] = (),
) -> str:
    """Return a summary of the episode, the prediction's errors, and missing parts."""
    time = episode.taxels.sample_ns
    seconds = (time[-1] - time[0]) / 1e9
    rate = f", {(len(time) - 1) / seconds:.1f} Hz" if seconds > 0 else ""
    # A counter that starts again goes back, and is no loss.
    lost = int(np.maximum(np.diff(episode.taxels.counter) - 1, 0).sum())
    lines = [
        f"# Episode {episode.number}",
        "",
        f"- **Press** {of_press(episode.press)}",
        of_sensor(episode.sensor),
        f"- **Recording** {len(time)} frames in {seconds:.2f} s{rate}, {lost} lost"
        + ("" if episode.complete else "; **interrupted or salvaged**"),
    ]
    if label is not None:
        lines.append(
            f"- **Label** to {label.signed.max(initial=0.0):.2f} mm, numerical error up to "
            f"{label.error.max(initial=0.0):.3f} mm"
        )
    lines += of_prediction(prediction, maps)
    absent = missing(episode, label, prediction, maps, cameras)
    if absent:
        lines += ["", "Not shown: " + "; ".join(absent) + "."]
    if remarks or episode.notes:
        lines += ["", *(f"- {note}" for note in (*remarks, *episode.notes))]
    return "\n".join(lines)


def of_dataset_episode(
    dataset: Dataset,
    entry: DatasetEpisode,
    prediction: PredictedMaps | None,
    maps: tuple[DepthMaps, ...],
    remarks: tuple[str, ...],
    count: int,
) -> str:
    """Return a summary of the dataset's episode, its origin, and the prediction's errors."""
    sensor, record = dataset.sensors[entry.sensor], entry.record
    frames = entry.stop - entry.start
    lines = [f"# Episode {entry.index} of {count}", ""]
    if record is not None:
        lines.append(f"- **Press** {of_press(record.configuration)}")
    lines += [
        of_sensor(sensor),
        f"- **Dataset** {dataset.root.resolve().name}, {frames} frames in this episode at {dataset.fps} Hz",
    ]
    if record is not None:
        lines.append(
            f"- **Recording** {record.recording_file}, {100 * record.quality:.0f} % of its frames valid"
            + ("" if record.complete else "; **interrupted or salvaged**")
        )
    lines += of_prediction(prediction, maps)
    notes = (*remarks, *(record.notes if record else ("an edit of the dataset lost where this episode comes from",)))
    return "\n".join([*lines, *(["", *(f"- {note}" for note in notes)] if notes else [])])


def of_prediction(prediction: PredictedMaps | None, maps: tuple[DepthMaps, ...]) -> list[str]:
    """Return the network of a prediction and its errors; nothing without one."""
    if prediction is None:
        return []
    part = "of another dataset" if prediction.part == "other dataset" else f"in its {prediction.part} part"
    lines = [f"- **Prediction** {prediction.network}, checkpoint {prediction.checkpoint[:12]}, episode {part}"]
    error = press_error(maps)
    return [*lines, f"- **Error** {error}"] if error else lines


def missing(
    episode: Episode,
    label: Label | ShownLabel | None,
    prediction: PredictedMaps | None,
    maps: tuple[DepthMaps, ...],
    cameras: tuple[CameraView, ...],
) -> list[str]:
    """Return the parts that could not be shown, one phrase each."""
    words = []
    if label is None:
        words.append("no label, so the skin is undeformed" if prediction is None else "no label")
    if label is not None and prediction is not None and not any(m.name == "error" for m in maps):
        words.append("label and prediction share no frame")
    if not len(episode.tip_ns):
        words.append("no commanded path")
    if not episode.phases:
        words.append("no phase is marked")
    for camera in cameras:
        if not len(camera.image_ns):
            words.append(f"camera {camera.name} has no image")
        elif not np.isfinite(camera.cube_position).all(axis=1).any():
            words.append(f"camera {camera.name} sees no tag")
    return words


def plain(markdown: str) -> str:
    """Return a summary without its heading, tables and marks, one item a line, long ones broken."""
    items = [line.removeprefix("- ").replace("**", "") for line in markdown.splitlines()]
    lines = [wrap(item, LINE_LENGTH) for item in items if not item.startswith(("#", "|"))]
    return "\n".join(line for wrapped in lines for line in wrapped)
