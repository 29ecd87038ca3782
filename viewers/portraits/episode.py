"""An episode: readings and tip depth over time, and the label where it is deepest."""

import numpy as np
from matplotlib.figure import Figure

from tacdata.recording.episode import Episode
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Episode) -> Figure:
    """Draw the change of each taxel, the commanded depth, and the deepest map of the label if there is one."""
    label = noun.label
    figure = parts.figure()
    left, *right = np.atleast_1d(figure.subplots(1, 1 if label is None else 2)).tolist()
    if len(noun.times):
        parts.curves(left, noun.times, noun.readings - noun.readings[0], "change of reading [counts]")
        depth = left.twinx()
        depth.plot(noun.times, noun.depth, color="0.3", linestyle="--", linewidth=1.0)
        depth.set(ylabel="depth of the tip [mm], dashed")
    left.set_title(f"{noun.path.name}: {noun.press.indenter.shape}")
    if label is not None:
        parts.depth_map(right[0], label.deepest, "label at the deepest frame", noun.sensor.map)
    return figure
