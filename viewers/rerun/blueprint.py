"""How an episode is laid out in Rerun."""

import rerun.blueprint as rrb

from tacdata.viewers.rerun.columns import entity, marks_of
from tacdata.viewers.rerun.timelines import HOST
from tacdata.viewers.scene.scene import Scene

MAP_TITLES = {
    "label": "Label: depth, 0 to {high:g} mm",
    "prediction": "Prediction: depth, 0 to {high:g} mm",
    "error": "Prediction − label, ±{high:g} mm",
    "pressure": "Pressure, 0 to {high:g} kPa",
    "shear": "Shear, 0 to {high:g} kPa",
    "board": "Protrusions on the board, 0 to {high:g} kPa",
}
SKIN_TITLES = {
    "label": "Skin by the label [mm]",
    "prediction": "Skin by the prediction [mm]",
    "undeformed": "Skin without a label: undeformed [mm]",
}
EYE = (-10.0, -16.5, 14.0)
"""Where the skin is seen from [mm]."""


def episode_blueprint(scene: Scene, follows: bool = False, stands: bool = False) -> rrb.Blueprint:
    """Return the layout for one episode: skin, maps and curves in rows, text and cameras next to them.

    Args:
        scene: The scene.
        follows: Whether time follows arriving data, for a recording in progress.
        stands: Whether time is fixed by an address.
    """
    skins = [skin_view(s.name, SKIN_TITLES[s.name], scene) for s in scene.surfaces]
    rows: list[rrb.ContainerLike] = [rrb.Horizontal(*skins)]
    if scene.clouds:
        rows = [rrb.Tabs(rrb.Horizontal(*skins, name="Skin"), _contact())]
    shares = [7.0]
    if scene.maps:
        rows.append(rrb.Horizontal(*[_map(m.name, m.scale.high) for m in scene.maps], _heat_map(scene)))
        shares.append(5.0)
    rows.append(_curves(scene))
    shares.append(5.0)
    if scene.phases or scene.notes:
        name = " and ".join(word for word, content in (("Phases", scene.phases), ("notes", scene.notes)) if content)
        rows.append(rrb.StateTimelineView(origin="/", contents=["phase", "notes"], name=name))
        shares.append(3.8 if scene.phases and scene.notes else 2.2)
    main = rrb.Vertical(*rows, row_shares=shares)
    return rrb.Blueprint(
        rrb.Horizontal(main, _side(scene), column_shares=[3, 1]),
        _time_panel(follows, stands),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _time_panel(follows: bool, stands: bool) -> rrb.TimePanel:
    if stands:
        return rrb.TimePanel(timeline=HOST, state="collapsed", play_state="paused")
    if follows:
        return rrb.TimePanel(timeline=HOST, state="collapsed", play_state="following")
    return rrb.TimePanel(timeline=HOST, state="collapsed", loop_mode="All")


def skin_view(name: str, title: str, scene: Scene) -> rrb.Spatial3DView:
    """Return the view of one of a scene's skins, the others left out of it."""
    exclusions = [f"- /{entity('world/skin', s.name)}/**" for s in scene.surfaces if s.name != name]
    return rrb.Spatial3DView(
        origin="world",
        contents=["$origin/**", *exclusions],
        name=title,
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=(0.0, 0.0, 2.6)),
        line_grid=rrb.LineGrid3D(visible=False),
    )


def _contact() -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        contents=["contact/**", "world/footprint", "world/indenter/**"],
        name="Contact points: pressed in by more than 0.1 mm",
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=(0.0, 0.0, 2.6)),
        line_grid=rrb.LineGrid3D(visible=False),
    )


def _side(scene: Scene) -> rrb.Container:
    parts: list[rrb.ContainerLike] = [rrb.TextDocumentView(origin="about", name="About")]
    for camera in scene.cameras:
        path = f"cameras/{camera.name}"
        parts.append(rrb.Spatial2DView(origin=f"{path}/image", contents=f"{path}/**", name=f"Camera {camera.name}"))
    if not scene.maps:
        parts.append(_heat_map(scene))
    return rrb.Vertical(*parts)


def _map(name: str, high: float) -> rrb.Spatial2DView:
    contents = [entity("maps", name), f"{marks_of(name)}/**"]
    return rrb.Spatial2DView(origin="maps", contents=contents, name=MAP_TITLES[name].format(high=high))


def _heat_map(scene: Scene) -> rrb.Spatial2DView:
    scale = scene.taxels.scale
    return rrb.Spatial2DView(origin="heat_map", name=f"Taxels, {scale.low:g} to {scale.high:g} {scale.unit}")


def _curves(scene: Scene) -> rrb.Container:
    """Return the taxels' change next to tabs with all other curves over time."""
    hidden = rrb.PlotLegend(visible=False)
    origin = "curves/taxels/change"
    first = rrb.TimeSeriesView(origin=origin, name=f"Change since rest [{scene.taxels.scale.unit}]", plot_legend=hidden)
    tabs: list[rrb.ContainerLike] = []
    if scene.tip is not None:
        tabs.append(rrb.TimeSeriesView(origin="curves/tip/nominal", name="Tip [mm]"))
    for curves in scene.curves:
        if curves.name == "taxels/change" or curves.name.startswith("clock/"):
            continue
        title = f"{curves.name.replace('_', ' ').replace('/', ' ')} [{curves.unit}]"
        legend = hidden if curves.name.startswith("taxels/") else None
        tabs.append(rrb.TimeSeriesView(origin=entity("curves", curves.name), name=title, plot_legend=legend))
    if any(c.name.startswith("clock/") for c in scene.curves):
        tabs.append(rrb.TimeSeriesView(origin="curves/clock", name="Clock: arrival after sample [ms]"))
    return rrb.Horizontal(first, rrb.Tabs(*tabs))
