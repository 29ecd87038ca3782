"""A session: where its plan presses, how deep, and which presses are recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tacdata.viewers.portraits import portrait as parts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tacdata.recording.session import Session


def portrait(noun: Session) -> Figure:
    """Draw the sites of the presses over the taxels, coloured by depth; open circles are not recorded."""
    figure = parts.figure(width=5.5)
    axes = figure.subplots()
    axes.plot(*noun.sensor.taxels.centers.T, "s", color="0.85", markersize=9, zorder=0)
    done = noun.done
    depths = [press.depth for press in noun.plan.presses]
    for recorded, face in ((True, None), (False, "none")):
        presses = [press for press in noun.plan.presses if (press.index in done) == recorded]
        if presses:
            x, y, depth = np.array([(press.x, press.y, press.depth) for press in presses]).T
            points = axes.scatter(x, y, c=depth, vmin=min(depths), vmax=max(depths), cmap="viridis", zorder=2)
            if face:
                points.set_facecolor(face)
            else:
                figure.colorbar(points, ax=axes, label="depth [mm]")
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title=f"{len(done)} of {len(depths)} presses recorded")
    return figure
