"""How a comparison is laid out in Rerun: both sides, then their difference, one timeline."""

import rerun.blueprint as rrb

from tacdata.viewers.rerun.blueprint import skin_view
from tacdata.viewers.rerun.columns import entity, heat_map_of
from tacdata.viewers.rerun.timelines import ELAPSED, HOST
from tacdata.viewers.scene.scene import Scene


def comparison_blueprint(scene: Scene) -> rrb.Blueprint:
    """Return skins, maps or arrays in rows, curves below, and the text next to them."""
    rows: list[rrb.ContainerLike] = []
    shares: list[float] = []
    if scene.surfaces:
        rows.append(rrb.Horizontal(*[skin_view(s.name, f"Skin: {s.name} [mm]", scene) for s in scene.surfaces]))
        shares.append(5.0)
    if scene.maps:
        rows.append(rrb.Grid(*[_map(m.name, m.title) for m in scene.maps], grid_columns=3))
        shares.append(5.0 if len(scene.maps) <= 3 else 8.0)
    arrays = [a for a in scene.arrays if a.name]
    if arrays:
        rows.append(
            rrb.Grid(
                *[
                    rrb.Spatial2DView(
                        origin=heat_map_of(a), name=f"{a.name}, {a.scale.low:g} to {a.scale.high:g} {a.scale.unit}"
                    )
                    for a in arrays
                ],
                grid_columns=3,
            )
        )
        shares.append(5.0)
    rows.append(_curves(scene))
    shares.append(4.0)
    about = rrb.TextDocumentView(origin="about", name="About")
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(*rows, row_shares=shares), about, column_shares=[3, 1]),
        rrb.TimePanel(timeline=HOST if scene.on_host_clock else ELAPSED, state="collapsed", loop_mode="All"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _map(name: str, title: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(origin="maps", contents=[entity("maps", name), "maps/marks/**"], name=title)


def _curves(scene: Scene) -> rrb.Container:
    hidden = rrb.PlotLegend(visible=False)
    views = []
    for curves in scene.curves:
        name = f"{curves.name.replace('/', ': ')} [{curves.unit}]"
        legend = hidden if len(curves.labels) > 12 else None
        views.append(rrb.TimeSeriesView(origin=entity("curves", curves.name), name=name, plot_legend=legend))
    return rrb.Horizontal(views[0], rrb.Tabs(*views[1:])) if len(views) > 1 else rrb.Horizontal(*views)
