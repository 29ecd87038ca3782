"""The scene of a recording, its label and a prediction. The summary lists missing parts."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from tacdata.errors import FormatError
from tacdata.labels import Label
from tacdata.recording.episode import PHASES, Episode, TaxelStream
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.parts import camera_view, maps, signals, skin_surface, summary
from tacdata.viewers.parts.label import ShownLabel
from tacdata.viewers.scene.scene import DepthMaps, Scene


def episode_scene(
    episode: Episode,
    label: Label | ShownLabel | None = None,
    prediction: PredictedMaps | None = None,
    images: Iterable[tuple[str, int, bytes]] = (),
    remarks: tuple[str, ...] = (),
    image_times: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
    unit: str = "counts",
) -> Scene:
    """Return the scene of a recording.

    Args:
        episode: The recording.
        label: Its label, if there is one.
        prediction: A network's maps for it, if there are any.
        images: Camera name, time of exposure [ns] and JPEG image.
        remarks: Further remarks, one phrase each.
        image_times: Camera name -> times of exposure and of arrival [ns], shape (n,) each.
        unit: Of the board's readings.

    Raises:
        FormatError: If the recording holds nothing, or a map has another grid than the sensor.
    """
    if not len(episode.taxels.sample_ns):
        episode, remarks = _without_taxels(episode), (*remarks, "not one taxel frame: what else there is, is shown")
    time, sensor = episode.taxels.sample_ns, episode.sensor
    label = ShownLabel.of(label) if isinstance(label, Label) else label
    label_pair = (label.map_ns, np.maximum(label.signed, 0.0)) if label else None
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
    layers = maps.depth_maps(sensor, label_pair, prediction_pair)
    if label and label.traction is not None:
        layers += maps.contact_maps(sensor, label.map_ns, label.traction)
    if label and label.taxel_pressure is not None:
        layers += (maps.board_map(sensor, label.map_ns, label.taxel_pressure),)
    # On the frames' times: curves of one scene share a cursor.
    tip = episode.tip_at(time) if len(episode.tip_ns) else None
    cameras = camera_view.camera_views(episode, images)
    curves = signals.episode_curves(episode, unit) + (signals.label_curves(label) if label else ())
    curves += tuple(signals.delays(f"camera {name}", *pair) for name, pair in (image_times or {}).items())
    curves += maps.error_curves(layers)
    drawn = maps.thinned(layers)
    surfaces = skin_surface.surfaces(sensor, int(time[0]), drawn, (label.map_ns, label.signed) if label else None)
    remarks += thinned_remark(len(label.time_ns) if label else len(layers[0].time_ns) if layers else 0, drawn)
    return Scene(
        title=f"{episode.path.resolve().parent.name}/{episode.path.stem}",
        summary=summary.of_episode(episode, label, prediction, layers, cameras, remarks),
        frame_ns=time,
        frame=_counter(episode.taxels.counter),
        footprint=skin_surface.footprint(sensor),
        curves=tuple(map(signals.thinned, curves)),
        arrays=(signals.taxel_array(sensor, time, change, unit=unit),),
        tip=None if tip is None else signals.thinned(signals.tip_curves("nominal", time, tip)),
        maps=drawn,
        surfaces=surfaces,
        clouds=(skin_surface.contact_cloud(surfaces[0]),) if drawn else (),
        bodies=() if tip is None else (skin_surface.indenter_body(sensor, episode.press, time, tip),),
        cameras=cameras,
        phases=signals.spans(episode.phases),
        device_ns=_device_times(episode),
    )


def _without_taxels(episode: Episode) -> Episode:
    """Return an episode whose board sent nothing, with missing readings at the times of its other streams.

    Raises:
        FormatError: If there is no other stream.
    """
    streams = [episode.cnc.sample_ns, episode.tip_ns, *(tags.sample_ns for tags in episode.tags)]
    time = next((times for times in streams if len(times) > 1), None)
    if time is None:
        raise FormatError(
            f"{episode.path}: not one taxel frame, and no other stream",
            "a recording with readings",
            "run `tacdata check` on it, or view another episode",
        )
    counts = np.full((len(time), episode.sensor.taxels.count), np.nan)
    return replace(episode, taxels=TaxelStream(time, time, np.full(len(time), -1), counts))


def thinned_remark(count: int, drawn: tuple[DepthMaps, ...]) -> tuple[str, ...]:
    """Return in words how many of ``count`` maps are drawn, where it is not all."""
    if not drawn or count == len(drawn[0].time_ns):
        return ()
    return (f"{len(drawn[0].time_ns)} of {count} maps are drawn, the deepest of each stretch",)


def _device_times(episode: Episode) -> np.ndarray:
    device_ns = episode.taxels.device_ns
    has_clock = device_ns is not None and len(device_ns) and (device_ns >= 0).all()
    return device_ns if has_clock else np.zeros(0, dtype=np.int64)


def _counter(counter: np.ndarray) -> np.ndarray:
    # A board without a counter marks every frame -1; then the frames are numbered as they came.
    return counter if (counter >= 0).all() else np.arange(len(counter))
