"""How a demonstration, or a robot's targets, are laid out in Rerun."""

import numpy as np
import rerun.blueprint as rrb

from tacdata.viewers.rerun.blueprint import Rows, about_and_cameras, array_view, in_rows, looping, space_view
from tacdata.viewers.rerun.columns import entity
from tacdata.viewers.scene.scene import Scene


def hand_blueprint(scene: Scene) -> rrb.Blueprint:
    """Return fingers in space next to their maps, curves below, text and cameras at the side."""
    rows: Rows = [(6.0, rrb.Horizontal(_space(scene), *_felt(scene), column_shares=[3, 1]))]
    if scene.curves:
        rows.append((4.0, _curves(scene)))
    return in_rows(rows, about_and_cameras(scene), looping(scene))


def _space(scene: Scene) -> rrb.Spatial3DView:
    places = [t.position[np.isfinite(t.position).all(axis=1)] for t in scene.trails]
    points = np.concatenate(places) if places else np.zeros((0, 3))
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.full(3, 100.0))
    middle, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), 60.0)
    eye, target = tuple((middle + size * np.array([-0.7, -1.1, 0.8])).tolist()), tuple(middle.tolist())
    return space_view("/", ["world/**", "contact/**"], "Fingertips [mm]; pale: bridged", eye, target)


def _felt(scene: Scene) -> list[rrb.ContainerLike]:
    """Return a column with each finger's predicted map, and a tab behind it with its taxels."""
    pictures = [rrb.Spatial2DView(origin=entity("maps", m.name), name=m.title) for m in scene.maps]
    arrays = [array_view(a, f"{a.name}: taxels") for a in scene.arrays]
    tabs = []
    if pictures:
        tabs.append(rrb.Vertical(*pictures, name="Predicted depth"))
    if arrays:
        tabs.append(rrb.Vertical(*arrays, name="Taxels"))
    return [rrb.Tabs(*tabs)] if tabs else []


def _curves(scene: Scene) -> rrb.Container:
    hidden = rrb.PlotLegend(visible=False)
    groups = dict.fromkeys(c.name.split("/")[0] for c in scene.curves)
    views = []
    for group in groups:
        members = [c for c in scene.curves if c.name.split("/")[0] == group]
        legend = hidden if group == "taxels" or len(members) * len(members[0].labels) > 12 else None
        title = {"clock": "clock: arrival after sample", "spread": "standard deviation of the position"}.get(
            group, group
        )
        views.append(
            rrb.TimeSeriesView(origin=entity("curves", group), name=f"{title} [{members[0].unit}]", plot_legend=legend)
        )
    return rrb.Horizontal(views[0], rrb.Tabs(*views[1:])) if len(views) > 1 else rrb.Horizontal(views[0])
