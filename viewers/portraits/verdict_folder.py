"""A verdict: its page of residuals, by effect and place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tacdata.viewers.pictures.pages import other_page
from tacdata.viewers.source import scene_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tacdata.discrepancy.verdict_folder import VerdictFolder


def portrait(noun: VerdictFolder) -> Figure:
    """Draw the page that `tacdata view` writes of a verdict."""
    return other_page(scene_at(noun.folder))
