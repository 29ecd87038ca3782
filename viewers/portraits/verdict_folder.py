"""A verdict: its page of residuals, by effect and place."""

from matplotlib.figure import Figure

from tacdata.discrepancy.verdict_folder import VerdictFolder
from tacdata.viewers.pictures.pages import other_page
from tacdata.viewers.source import scene_at


def portrait(noun: VerdictFolder) -> Figure:
    """Draw the page that `tacdata view` writes of a verdict."""
    return other_page(scene_at(noun.folder))
