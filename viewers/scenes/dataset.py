"""The scene of an episode of a dataset, with a network's prediction."""

import numpy as np

from tacdata.dataset.format import features
from tacdata.dataset.reader import Dataset
from tacdata.errors import FormatError, UsageError
from tacdata.recording.episode import PHASES
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.parts import maps, signals, skin_surface, summary
from tacdata.viewers.scene.scene import Curves, Scene, Span
from tacdata.viewers.scenes.episode import thinned_remark
from tacdata.viewers.scenes.single_episode import SHOWN


def dataset_scene(
    dataset: Dataset,
    number: int,
    prediction: PredictedMaps | None = None,
    remarks: tuple[str, ...] = (),
    total: int | None = None,
) -> Scene:
    """Return a dataset's content of one episode: signals, label and tip, without recording and cameras.

    Args:
        dataset: The dataset.
        number: Number of the episode in it.
        prediction: A network's maps for it, if there are any.
        remarks: Further remarks, one phrase each.
        total: Episodes of the whole dataset, where it was not read whole.

    Raises:
        UsageError: If the dataset has no such episode.
        FormatError: If the prediction's maps have another grid than the sensor.
    """
    count = len(dataset.episodes) if total is None else total
    entry = next((candidate for candidate in dataset.episodes if candidate.index == number), None)
    if entry is None:
        raise UsageError(f"--episode {number}", f"0 to {count - 1} in {dataset.root}", "choose one of them")
    sensor = dataset.sensors[entry.sensor]
    part = slice(entry.start, entry.stop)
    column = {key: np.asarray(dataset[key][part]) for key in SHOWN}
    time, tip, depth = column[features.TIME], column[features.TIP].astype(float), column[features.DEPTH]
    if prediction is not None and prediction.depth.shape[1:] != sensor.map.shape:
        raise FormatError(
            f"prediction with maps of {prediction.depth.shape[1:]} pixels",
            f"{sensor.map.shape} pixels, as the dataset's sensor {sensor.name} says",
            "give the predictions made for this dataset",
        )
    pair = (prediction.time_ns, prediction.depth) if prediction else None
    layers = maps.depth_maps(sensor, (time, depth), pair)
    labels = signals.taxel_labels(sensor)
    state = column[features.STATE].astype(float)
    curves = (
        Curves("taxels/change", "counts", labels, time, state),
        Curves("taxels/raw", "counts", labels, time, column[features.RAW]),
        Curves("force", "N", ("x", "y", "z"), time, column[features.FORCE]),
    )
    press, drawn = entry.press, maps.thinned(layers)
    surfaces = skin_surface.surfaces(sensor, int(time[0]), drawn, None)
    remarks += thinned_remark(len(layers[0].time_ns) if layers else 0, drawn)
    return Scene(
        title=f"{dataset.root.resolve().name}/episode {number}",
        summary=summary.of_dataset_episode(dataset, entry, prediction, layers, remarks, count),
        frame_ns=time,
        frame=np.arange(len(time)),
        footprint=skin_surface.footprint(sensor),
        curves=tuple(map(signals.thinned, curves + maps.error_curves(layers))),
        arrays=(signals.taxel_array(sensor, time, state),),
        tip=signals.thinned(signals.tip_curves("nominal", time, tip)),
        maps=drawn,
        surfaces=surfaces,
        clouds=(skin_surface.contact_cloud(surfaces[0]),),
        bodies=(skin_surface.indenter_body(sensor, press, time, tip),) if press else (),
        cameras=(),
        phases=phase_spans(time, column[features.PHASE]),
    )


def phase_spans(time_ns: np.ndarray, phase: np.ndarray) -> tuple[Span, ...]:
    """Return the stretches of equal phase.

    Args:
        time_ns: Times of the frames [ns], shape (n,).
        phase: Index into `PHASES` of each frame, -1 outside every phase, shape (n,).
    """
    starts = np.flatnonzero(np.diff(phase, prepend=phase[:1] - 1))
    ends = np.append(starts[1:], len(phase) - 1)
    return tuple(
        Span(PHASES[phase[a]], int(time_ns[a]), int(time_ns[b]))
        for a, b in zip(starts, ends, strict=True)
        if phase[a] >= 0
    )
