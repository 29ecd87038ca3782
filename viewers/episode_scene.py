"""From a recording, its label and a network's prediction to a scene. What is missing is said, not hidden."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels import Label
from tacdata.recording.episode import PHASES, Episode
from training.prediction import Prediction
from viewers import camera_view, maps, signals, skin_surface, summary
from viewers.scene import Scene


def episode_scene(
    episode: Episode,
    label: Label | None = None,
    prediction: Prediction | None = None,
    images: Iterable[tuple[str, int, bytes]] = (),
    remarks: tuple[str, ...] = (),
) -> Scene:
    """Return what there is to see of a recording.

    Args:
        episode: The recording.
        label: Its label, if there is one.
        prediction: A network's maps for it, if there are any.
        images: Camera name, time of exposure [ns] and JPEG image.
        remarks: What else a person should read, each in words.

    Raises:
        FormatError: If the recording holds no taxel frame, or a map has another grid than the sensor.
    """
    time, sensor = episode.taxels.sample_ns, episode.sensor
    if not len(time):
        raise FormatError(
            f"{episode.path}: not one taxel frame",
            "a recording with taxel frames",
            "run `tacdata check` on it, or view another episode",
        )
    label_pair = (label.time_ns, label.depth) if label else None
    prediction_pair = (prediction.time_ns, prediction.depth) if prediction else None
    for name, pair in (("label", label_pair), ("prediction", prediction_pair)):
        if pair is not None and pair[1].shape[1:] != sensor.map.shape:
            raise FormatError(
                f"{name} of {episode.path.name} has maps of {pair[1].shape[1:]} pixels",
                f"{sensor.map.shape} pixels, as its sensor {sensor.name} says",
                f"give the {name} that was made for this sensor",
            )
    resting = episode.phase_at(time) == PHASES.index("rest")
    change = signals.signal_change(episode.taxels.counts, resting)
    shown = maps.depth_maps(sensor, label_pair, prediction_pair)
    tip = episode.tip_at(time) if len(episode.tip_ns) else None
    cameras = camera_view.camera_views(episode, images)
    curves = signals.episode_curves(episode) + (signals.label_curves(label) if label else ())
    return Scene(
        title=f"{episode.path.resolve().parent.name}/{episode.path.stem}",
        summary=summary.of_episode(episode, label, prediction, shown, cameras, remarks),
        frame_ns=time,
        frame=_counter(episode.taxels.counter),
        footprint=skin_surface.footprint(sensor),
        curves=curves + maps.error_curves(shown),
        taxels=signals.taxel_array(sensor, time, change),
        tip=None if tip is None else signals.tip_curves("nominal", time, tip),
        maps=shown,
        surfaces=skin_surface.surfaces(sensor, int(time[0]), shown, label.signed if label else None),
        bodies=() if tip is None else (skin_surface.indenter_body(sensor, episode.press, time, tip),),
        cameras=cameras,
        phases=signals.spans(episode.phases),
    )


def _counter(counter: np.ndarray) -> np.ndarray:
    # A board without a counter marks every frame -1; then the frames are numbered as they came.
    return counter if (counter >= 0).all() else np.arange(len(counter))
