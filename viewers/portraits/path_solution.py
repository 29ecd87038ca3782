"""A solved press: the deepest map, and force over depth on the way down and up."""

import numpy as np
from matplotlib.figure import Figure

from tacdata.labels import PathSolution
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: PathSolution) -> Figure:
    """Draw the map of the deepest state and the normal force over depth."""
    figure = parts.figure()
    left, right = figure.subplots(1, 2)
    deepest = int(np.argmax(noun.depth))
    parts.depth_map(left, noun.surface[deepest], f"at {noun.depth[deepest]:.2f} mm")
    for name, part in (("loading", slice(deepest + 1)), ("unloading", slice(deepest, None))):
        right.errorbar(noun.depth[part], noun.force[part, 2], noun.force_error[part], marker=".", label=name)
    right.set(xlabel="depth [mm]", ylabel="normal force [N]")
    right.spines[["top", "right"]].set_visible(False)
    right.legend(frameon=False)
    return figure
