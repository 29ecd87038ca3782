"""The scene of a prediction alone."""

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.parts import maps as depth_maps
from tacdata.viewers.parts import signals, skin_surface
from tacdata.viewers.parts.maps import DEPTH_FLOOR
from tacdata.viewers.scene.color_scale import scale_of
from tacdata.viewers.scene.scene import Curves, DepthMaps, Scene


def prediction_scene(title: str, prediction: PredictedMaps, sensor: Sensor | None, files: int) -> Scene:
    """Return predicted maps, without label and signals.

    Args:
        title: Heading.
        prediction: The maps.
        sensor: The sensor that the network was trained for; without it maps are drawn in pixels.
        files: How many predictions lie there.
    """
    depth, time = prediction.depth, prediction.time_ns
    fits = sensor is not None and sensor.map.shape == depth.shape[1:]
    x, y = (sensor.map.x, sensor.map.y) if sensor and fits else (np.arange(n, dtype=float) for n in depth.shape[1:])
    scale = scale_of(np.array([float(depth.max(initial=0.0))]), "mm", floor=DEPTH_FLOOR)
    words = f"predicted depth, 0 to {scale.high:g} mm" + ("" if fits else "; axes in pixels")
    drawn = depth_maps.thinned((DepthMaps("prediction", x, y, time, depth, scale, words),))
    flat = depth.reshape(len(depth), -1)
    curves = Curves("predicted depth", "mm", ("largest", "mean"), time, np.column_stack([flat.max(1), flat.mean(1)]))
    lines = [
        f"# {title}",
        "",
        f"- **Prediction** of episode {prediction.episode} by {prediction.network}, checkpoint "
        f"{prediction.checkpoint[:12]}, part {prediction.part}",
        f"- **Depth** to {flat.max():.2f} mm in {len(time)} frames; an estimate, no measurement",
        "",
        "Not shown: label, signals and cameras; `tacdata view DATASET --predictions RUN` shows them next to it.",
    ]
    if files > 1:
        lines += ["", f"{files} predictions lie there: choose one with --episode."]
    if not fits:
        lines += ["", "- no checkpoint of this sensor is next to it, so the maps are in pixels"]
    return Scene(
        title,
        "\n".join(lines),
        time,
        np.arange(len(time)),
        curves=(signals.thinned(curves),),
        maps=drawn,
        surfaces=skin_surface.faces(sensor, drawn) if sensor and fits else (),
        footprint=skin_surface.footprint(sensor) if sensor and fits else None,
        kind="comparison",
    )
