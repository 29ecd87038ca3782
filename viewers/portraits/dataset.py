"""A dataset: how deep its episodes are, and the deepest frame of it."""

import numpy as np
from matplotlib.figure import Figure

from tacdata.dataset import Dataset
from tacdata.dataset.format import features
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Dataset) -> Figure:
    """Draw the depth of the tip in each episode and the deepest labelled map."""
    figure = parts.figure()
    left, right = figure.subplots(1, 2)
    tip = noun[features.TIP]
    deepest = [float(tip[episode.start : episode.stop, 2].max()) for episode in noun.episodes]
    left.hist(deepest, bins=20, color="0.4")
    left.set(xlabel="greatest depth of the tip [mm]", ylabel="episodes", title=str(noun.root))
    frame = int(np.argmax(tip[:, 2]))
    grid = next(iter(noun.sensors.values())).map
    parts.depth_map(right, np.asarray(noun[features.DEPTH][frame]), f"label of frame {frame}", grid)
    return figure
