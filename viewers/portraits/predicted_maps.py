"""The maps that a network predicts for an episode: the deepest of them, and the greatest depth over time."""

import numpy as np
from matplotlib.figure import Figure

from tacdata.training.inference.prediction import PredictedMaps
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: PredictedMaps) -> Figure:
    """Draw the deepest predicted map and the greatest depth of each frame."""
    figure = parts.figure()
    left, right = figure.subplots(1, 2)
    greatest = noun.depth.max(axis=(1, 2))
    frame = int(np.argmax(greatest))
    parts.depth_map(left, noun.depth[frame], f"{noun.network}: frame {frame} of episode {noun.episode}")
    parts.curves(right, (noun.time_ns - noun.time_ns[0]) / 1e9, greatest, "greatest predicted depth [mm]")
    return figure
