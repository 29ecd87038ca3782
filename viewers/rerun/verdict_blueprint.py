"""How a verdict or a revision is laid out in Rerun."""

import rerun.blueprint as rrb

from tacdata.viewers.parts.residual_curves import READINGS, RESIDUALS
from tacdata.viewers.rerun.blueprint import without_panels
from tacdata.viewers.rerun.columns import entity
from tacdata.viewers.rerun.timelines import ELAPSED
from tacdata.viewers.scene.scene import Curves, Scene


def verdict_blueprint(scene: Scene) -> rrb.Blueprint:
    """Return the text next to bars, and curves where there are some."""
    parts: list[rrb.ContainerLike] = [
        rrb.TextDocumentView(origin=f"bars/{bars.name}", name=bars.title) for bars in scene.bars
    ]
    streams = [c.name.partition("/")[2] for c in scene.curves if c.name.startswith(f"{READINGS}/")]
    parts += [_series(c) for c in scene.curves if not streams]
    if streams:
        parts.append(_streams(scene, streams))
    for page in scene.pages:
        parts.insert(0, rrb.Spatial2DView(origin=f"pages/{page.name}", name=page.title))
    columns = [rrb.TextDocumentView(origin="about", name="About")]
    grid = [rrb.Grid(*parts, grid_columns=2 if len(parts) > 3 else 1)] if parts else []
    views = rrb.Horizontal(*columns, *grid, column_shares=[2, 3][: 1 + len(grid)])
    return without_panels(views, rrb.TimePanel(timeline=ELAPSED, state="collapsed"))


def _series(curves: Curves) -> rrb.TimeSeriesView:
    name = f"{curves.name.replace('_', ' ').replace('/', ': ')} [{curves.unit}]"
    return rrb.TimeSeriesView(origin=entity("curves", curves.name), name=name)


def _streams(scene: Scene, streams: list[str]) -> rrb.Tabs:
    """Return a tab for each stream: readings, their residual, the depth; the stream with the largest first."""
    by_name = {c.name: c for c in scene.curves}
    tabs = []
    for name in streams:
        curves = [by_name[f"{READINGS}/{name}"], by_name[f"{RESIDUALS}/{name}"], by_name["depth"]]
        tabs.append(rrb.Vertical(*map(_series, curves), row_shares=[3, 2, 1], name=name.replace("_", " ")))
    return rrb.Tabs(*tabs, name="Readings")
