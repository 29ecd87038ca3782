"""A label: the deepest map, its error, and force and depth over time."""

from matplotlib.figure import Figure

from tacdata.labels import Label
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Label) -> Figure:
    """Draw the map of the deepest frame and the normal force over time."""
    figure = parts.figure()
    left, right = figure.subplots(1, 2)
    parts.depth_map(left, noun.deepest, f"label of episode {noun.episode}")
    seconds = (noun.time_ns - noun.time_ns[0]) / 1e9
    parts.curves(right, seconds, noun.force[:, 2:], "normal force [N]")
    error = right.twinx()
    error.plot(seconds, noun.error, color="0.5", linewidth=0.8, linestyle="--")
    error.set(ylabel="numerical error [mm], dashed")
    return figure
