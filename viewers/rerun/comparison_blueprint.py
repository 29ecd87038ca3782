"""How a comparison is laid out in Rerun: both sides, then their difference, one timeline."""

import rerun.blueprint as rrb

from tacdata.viewers.rerun.blueprint import Rows, about_and_cameras, array_view, in_rows, looping, map_view, skin_view
from tacdata.viewers.rerun.columns import entity
from tacdata.viewers.scene.scene import Scene


def comparison_blueprint(scene: Scene) -> rrb.Blueprint:
    """Return skins, maps or arrays in rows, curves below, and the text next to them."""
    rows: Rows = []
    if scene.surfaces:
        skins = [skin_view(s.name, f"Skin: {s.name} [mm]", scene) for s in scene.surfaces]
        rows.append((5.0, rrb.Horizontal(*skins)))
    if scene.maps:
        maps = [map_view(m.name, m.title) for m in scene.maps]
        rows.append((5.0 if len(maps) <= 3 else 8.0, rrb.Grid(*maps, grid_columns=3)))
    if arrays := [array_view(a, a.name) for a in scene.arrays if a.name]:
        rows.append((5.0, rrb.Grid(*arrays, grid_columns=3)))
    rows.append((4.0, _curves(scene)))
    return in_rows(rows, about_and_cameras(scene), looping(scene))


def _curves(scene: Scene) -> rrb.Container:
    hidden = rrb.PlotLegend(visible=False)
    views = []
    for curves in scene.curves:
        name = f"{curves.name.replace('/', ': ')} [{curves.unit}]"
        legend = hidden if len(curves.labels) > 12 else None
        views.append(rrb.TimeSeriesView(origin=entity("curves", curves.name), name=name, plot_legend=legend))
    return rrb.Horizontal(views[0], rrb.Tabs(*views[1:])) if len(views) > 1 else rrb.Horizontal(*views)
