"""Errors of the lab's table instead of the world: changes ``w.table``, not the world."""

import numpy as np

from worlds import skin
from worlds.hidden import hidden


@hidden("simulator", "simulator", called=("depth_nodes",), most=3)
def coarse_depths(w, s):
    """Too few depths were solved."""
    few = max(round(6 / s), 4)
    w.table["nodes"] = (41, 33, few)


@hidden("simulator", "simulator", called=(), most=3)
def wrong_tool(w, s):
    """The tips were simulated larger than they are."""
    w.table["radius_factor"] = 1 + 0.15 * s


@hidden("simulator", "simulator", called=("xy_offset",), most=3)
def half_cell(w, s):
    """The simulated array is displaced by half a cell: readings are those of a displaced sensor, labels are right."""
    w.table["shift"] = (0.5 * s * 2 * skin.HALF[0] / skin.MAP_X, 0.5 * s * 2 * skin.HALF[1] / skin.MAP_Y)


@hidden("simulator", "simulator", called=("thickness",), most=3)
def wrong_card(w, s):
    """The layer was simulated thinner than it is."""
    w.table["layer"] = skin.LAYER * (1 - 0.08 * s)


@hidden("simulator", "simulator", called=(), most=1)
def mirrored(w, s):
    """Rows of the array were numbered from the other end."""
    w.table["order"] = np.arange(skin.CHANNELS).reshape(skin.ROWS, skin.COLUMNS)[::-1].ravel()
