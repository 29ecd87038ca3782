"""How an episode is laid out in Rerun."""

from typing import Any

import rerun.blueprint as rrb

from tacdata.viewers.rerun.columns import entity, heat_map_of, marks_of
from tacdata.viewers.rerun.timelines import ELAPSED, HOST
from tacdata.viewers.scene.scene import Scene, TaxelArray

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
Place = tuple[float, float, float]
EYE: Place = (-10.0, -16.5, 14.0)
"""Where the skin is seen from [mm]."""


Rows = list[tuple[float, rrb.ContainerLike]]
"""Rows of a page from above, each with its share of the height."""


def episode_blueprint(scene: Scene, follows: bool = False, stands: bool = False) -> rrb.Blueprint:
    """Return the layout for one episode: skin, maps and curves in rows, text and cameras next to them.

    Args:
        scene: The scene.
        follows: Whether time follows arriving data, for a recording in progress.
        stands: Whether time is fixed by an address.
    """
    skins = [skin_view(s.name, SKIN_TITLES[s.name], scene) for s in scene.surfaces]
    skin_row = rrb.Tabs(rrb.Horizontal(*skins, name="Skin"), _contact()) if scene.clouds else rrb.Horizontal(*skins)
    rows: Rows = [(7.0, skin_row)]
    if scene.maps:
        maps = [map_view(m.name, MAP_TITLES[m.name].format(high=m.scale.high)) for m in scene.maps]
        rows.append((5.0, rrb.Horizontal(*maps, _heat_map(scene))))
    rows.append((5.0, _curves(scene)))
    if scene.phases or scene.notes:
        name = " and ".join(word for word, content in (("Phases", scene.phases), ("notes", scene.notes)) if content)
        states = rrb.StateTimelineView(origin="/", contents=["phase", "notes"], name=name)
        rows.append((3.8 if scene.phases and scene.notes else 2.2, states))
    side = [*about_and_cameras(scene), *([] if scene.maps else [_heat_map(scene)])]
    play: dict[str, Any] = {"loop_mode": "All"}
    if stands or follows:
        play = {"play_state": "paused" if stands else "following"}
    return in_rows(rows, side, rrb.TimePanel(timeline=HOST, state="collapsed", **play))


def in_rows(rows: Rows, side: list[rrb.ContainerLike], time: rrb.TimePanel) -> rrb.Blueprint:
    """Return rows of views over three quarters of the width, and further views at their side."""
    main = rrb.Vertical(*[view for _, view in rows], row_shares=[share for share, _ in rows])
    return without_panels(rrb.Horizontal(main, rrb.Vertical(*side), column_shares=[3, 1]), time)


def without_panels(views: rrb.Container, time: rrb.TimePanel) -> rrb.Blueprint:
    """Return views that have the window to themselves; Rerun's panels open at a click."""
    return rrb.Blueprint(views, time, rrb.SelectionPanel(state="collapsed"), rrb.BlueprintPanel(state="collapsed"))


def looping(scene: Scene) -> rrb.TimePanel:
    """Return a time panel that plays a scene again and again, on the timeline that it has."""
    return rrb.TimePanel(timeline=HOST if scene.on_host_clock else ELAPSED, state="collapsed", loop_mode="All")


def about_and_cameras(scene: Scene) -> list[rrb.ContainerLike]:
    """Return a scene's summary, and the view of each camera."""
    views: list[rrb.ContainerLike] = [rrb.TextDocumentView(origin="about", name="About")]
    for camera in scene.cameras:
        path = f"cameras/{camera.name}"
        views.append(rrb.Spatial2DView(origin=f"{path}/image", contents=f"{path}/**", name=f"Camera {camera.name}"))
    return views


def map_view(name: str, title: str) -> rrb.Spatial2DView:
    """Return the view of one of a scene's maps with the marks on it."""
    return rrb.Spatial2DView(origin="maps", contents=[entity("maps", name), f"{marks_of(name)}/**"], name=title)


def array_view(array: TaxelArray, title: str) -> rrb.Spatial2DView:
    """Return the view of an array's heat map, with the scale in its name."""
    scale = array.scale
    return rrb.Spatial2DView(origin=heat_map_of(array), name=f"{title}, {scale.low:g} to {scale.high:g} {scale.unit}")


def skin_view(name: str, title: str, scene: Scene) -> rrb.Spatial3DView:
    """Return the view of one of a scene's skins, the others left out of it."""
    exclusions = [f"- /{entity('world/skin', s.name)}/**" for s in scene.surfaces if s.name != name]
    return space_view("world", ["$origin/**", *exclusions], title)


def _contact() -> rrb.Spatial3DView:
    contents = ["contact/**", "world/footprint", "world/indenter/**"]
    return space_view("/", contents, "Contact points: pressed in by more than 0.1 mm")


def space_view(
    origin: str, contents: list[str], name: str, eye: Place = EYE, target: Place = (0.0, 0.0, 2.6)
) -> rrb.Spatial3DView:
    """Return a view of space without a ground grid, seen from a place [mm] towards another [mm]."""
    eye_controls, line_grid = rrb.EyeControls3D(position=eye, look_target=target), rrb.LineGrid3D(visible=False)
    return rrb.Spatial3DView(
        origin=origin, contents=contents, name=name, eye_controls=eye_controls, line_grid=line_grid
    )


def _heat_map(scene: Scene) -> rrb.Spatial2DView:
    return array_view(scene.taxels, "Taxels")


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
