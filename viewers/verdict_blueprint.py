"""How a verdict or a revision is laid out in Rerun."""

from __future__ import annotations

import rerun.blueprint as rrb

from viewers.rerun_parts import ELAPSED, entity
from viewers.scene import Bars, Scene


def verdict_blueprint(scene: Scene) -> rrb.Blueprint:
    """Return the words beside bars, and curves where there are some."""
    parts: list[rrb.ContainerLike] = [_bars(bars) for bars in scene.bars]
    for curves in scene.curves:
        name = f"{curves.name.replace('_', ' ')} [{curves.unit}]"
        parts.append(rrb.TimeSeriesView(origin=entity("curves", curves.name), name=name))
    for page in scene.pages:
        parts.insert(0, rrb.Spatial2DView(origin=f"pages/{page.name}", name=page.title))
    columns = [rrb.TextDocumentView(origin="about", name="About")]
    grid = [rrb.Grid(*parts, grid_columns=2 if len(parts) > 3 else 1)] if parts else []
    return rrb.Blueprint(
        rrb.Horizontal(*columns, *grid, column_shares=[2, 3][: 1 + len(grid)]),
        rrb.TimePanel(timeline=ELAPSED, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _bars(bars: Bars) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=f"bars/{bars.name}", name=bars.title)
