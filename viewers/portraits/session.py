"""A session: where its plan presses, how deep, and which presses are recorded."""

from matplotlib.figure import Figure

from tacdata.recording.session import Session
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Session) -> Figure:
    """Draw the sites of the presses over the taxels, coloured by depth; open circles are not recorded."""
    figure = parts.figure(width=5.5)
    axes = figure.subplots()
    axes.plot(*noun.sensor.taxels.centers.T, "s", color="0.85", markersize=9, zorder=0)
    done, presses = noun.done, noun.plan.presses
    parts.sites(axes, presses, {press.index for press in presses} - done)
    axes.set_title(f"{len(done)} of {len(presses)} presses recorded")
    return figure
