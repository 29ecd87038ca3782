"""A plan: where it presses, and how deep."""

from matplotlib.figure import Figure

from tacdata.plans import Plan
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Plan) -> Figure:
    """Draw the sites of the presses, coloured by depth."""
    figure = parts.figure(width=5.5)
    axes = figure.subplots()
    parts.sites(axes, noun.presses)
    axes.set_title(f"{noun.name}: {len(noun.presses)} presses")
    return figure
