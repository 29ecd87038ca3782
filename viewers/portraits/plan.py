"""A plan: where it presses, and how deep."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tacdata.viewers.portraits import portrait as parts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tacdata.plans import Plan


def portrait(noun: Plan) -> Figure:
    """Draw the sites of the presses, coloured by depth."""
    figure = parts.figure(width=5.5)
    axes = figure.subplots()
    parts.sites(axes, noun.presses)
    axes.set_title(f"{noun.name}: {len(noun.presses)} presses")
    return figure
