"""A tracked hand as a film: images of the cameras, fingertips in space, maps of each fingertip."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from scipy.spatial.transform import Rotation

from tacdata.viewers.pictures.felt_maps import FeltMaps
from tacdata.viewers.pictures.panels import shade_bridged
from tacdata.viewers.scene.color_scale import HUES
from tacdata.viewers.scene.moments import nearest
from tacdata.viewers.scene.scene import Body, CameraView, Curves, DepthMaps, Scene

SIZE, RESOLUTION = (13.0, 8.6), 80
"""Of a frame [inch], and dots an inch."""
TAIL = 1.5
"""Length of path behind a fingertip that stays in sight [s]."""
PLATE = 18.0
"""Length at which a fingertip is drawn, along the finger [mm]."""
NAME, WIDE = (0.5, 0.16), 3.7
"""Width and height of a finger's name, and width of a view [inch]."""
MARGIN = 20.0
"""Around all paths [mm]."""


def hand_times(scene: Scene, rate: float, limit: int) -> np.ndarray:
    """Return the times of a film's frames [ns]: from the first known fingertip to the last.

    Args:
        scene: A demonstration that was tracked.
        rate: Frames a second [Hz].
        limit: Frames at most; longer recordings are shown faster.
    """
    begin, end = _begin(scene), max(int(body.time_ns[-1]) for body in scene.bodies)
    return np.linspace(begin, end, int(np.clip((end - begin) / 1e9 * rate, 2, limit))).astype(np.int64)


class HandPage:
    """A tracked hand at one time: cameras above, fingertips from the side and from above, maps, predicted depth."""

    def __init__(self, scene: Scene) -> None:
        """Draw the static parts."""
        self._scene = scene
        self._fingers = [body.name for body in scene.bodies]
        self._bridged = {c.name.split("/", 1)[1]: c for c in scene.curves if c.name.startswith("fingertip/")}
        self.figure = Figure(figsize=SIZE, dpi=RESOLUTION)
        self.figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 0.95))
        self._title = self.figure.text(0.01, 0.985, "", fontsize=11, va="top", weight="bold")
        parts: Any = self.figure.subfigures(1, 2, width_ratios=[3.0, 1.0]) if scene.maps else [self.figure]
        heights = [1.5, 1.5, 0.8] if scene.cameras else [1.5, 0.8]
        rows: Any = parts[0].subfigures(len(heights), 1, height_ratios=heights)
        self._cameras: list[_CameraPicture] = []
        if scene.cameras:
            panels = rows[0].subplots(1, len(scene.cameras), squeeze=False)[0]
            pairs = zip(panels, scene.cameras, strict=True)
            self._cameras = [_CameraPicture(axes, view, scene.bodies) for axes, view in pairs]
        places = np.concatenate([body.position for body in scene.bodies])
        low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
        self._space = [
            _Plane(axes, scene.bodies, (horizontal, up), (low, high))
            for axes, (horizontal, up) in zip(rows[-2].subplots(1, 2), ((0, 2), (0, 1)), strict=True)
        ]
        self._line = _depth_curves(rows[-1].subplots(), scene, self._fingers)
        self._map_ns = {_finger(maps): maps.time_ns for maps in scene.maps}
        felt = {_finger(maps): (maps.values, maps.x, maps.y) for maps in scene.maps}
        self._maps = FeltMaps(parts[1], felt, scene.maps[0].scale) if felt else None
        self.show(_begin(scene))

    def show(self, time_ns: int) -> None:
        """Move everything to where it was at a time [ns]."""
        bridged = {name: _bridged_at(self._bridged.get(name), time_ns) for name in self._fingers}
        seconds = (time_ns - _begin(self._scene)) / 1e9
        words = f"{self._scene.title}, {seconds:.1f} s"
        if any(bridged.values()):
            words += ": no sighting of " + ", ".join(n for n, hit in bridged.items() if hit) + ", path bridged"
        self._title.set_text(words)
        for picture in self._cameras:
            picture.show(time_ns, bridged)
        for plane in self._space:
            plane.show(time_ns, bridged)
        self._line.set_xdata([seconds, seconds])
        if self._maps:
            rows = {name: nearest(times, time_ns) for name, times in self._map_ns.items()}
            self._maps.show(rows, [name for name, hit in bridged.items() if hit])


class _CameraPicture:
    """Images of one camera, with the paths: a dot away from its fingertip shows a wrong path."""

    def __init__(self, axes: Axes, view: CameraView, bodies: tuple[Body, ...]) -> None:
        self._view, self._bodies = view, bodies
        self._image = axes.imshow(np.full((view.height, view.width, 3), 255, np.uint8))
        axes.set(xticks=[], yticks=[], xlim=(0, view.width), ylim=(view.height, 0))
        axes.set_title(f"camera {view.name}", fontsize=9)
        self._marks = [_mark(axes, body.name, k) for k, body in enumerate(bodies)]

    def show(self, time_ns: int, bridged: dict[str, bool]) -> None:
        view = self._view
        if len(view.image_ns):
            self._image.set_data(_opened(view.images[nearest(view.image_ns, time_ns)]))
        # A camera without a known place gets no dots.
        pixels = [view.pixel(body.position[nearest(body.time_ns, time_ns)]) for body in self._bodies]
        places = np.array([np.full(2, np.nan) if place is None else place for place in pixels])
        # Rows of an image count downwards.
        names = apart(places * [1, -1], 0.14 * view.width, 0.06 * view.height) * [1, -1]
        for (dot, name), body, place, at in zip(self._marks, self._bodies, places, names, strict=True):
            dot.set_data([place[0]], [place[1]])
            dot.set_markerfacecolor("white" if bridged[body.name] else dot.get_color())
            name.set_position(tuple(at))
            name.set_visible(bool(np.isfinite(at).all()))


class _Plane:
    """Fingertips in one plane of space: a plate along each finger, a name, and the path just behind it."""

    def __init__(
        self, axes: Axes, bodies: tuple[Body, ...], dimensions: tuple[int, int], ends: tuple[np.ndarray, np.ndarray]
    ) -> None:
        self._bodies, self._shown = bodies, list(dimensions)
        horizontal, up = dimensions
        inch = float(ends[1][horizontal] - ends[0][horizontal]) / WIDE
        self._letters = NAME[0] * inch, NAME[1] * inch
        axes.set(xlim=(ends[0][horizontal], ends[1][horizontal]), ylim=(ends[0][up], ends[1][up]))
        axes.set_aspect("equal", adjustable="box")
        axes.set_title("from the side" if up == 2 else "from above", fontsize=9)
        axes.set_xlabel(f"{'xyz'[horizontal]} [mm]", fontsize=8)
        axes.set_ylabel(f"{'xyz'[up]} [mm]", fontsize=8)
        axes.tick_params(labelsize=7)
        self._marks = [_mark(axes, body.name, k) for k, body in enumerate(bodies)]
        self._tails = [axes.plot([], [], color=_color(k), linewidth=1.2)[0] for k in range(len(bodies))]
        self._plates = [
            axes.plot([], [], color=_color(k), linewidth=5, alpha=0.5, solid_capstyle="round")[0]
            for k in range(len(bodies))
        ]

    def show(self, time_ns: int, bridged: dict[str, bool]) -> None:
        tips = []
        for (dot, _), tail, plate, body in zip(self._marks, self._tails, self._plates, self._bodies, strict=True):
            row = nearest(body.time_ns, time_ns)
            # Only the latest part: the whole path would cover the scene.
            recent = (body.time_ns <= time_ns) & (body.time_ns >= time_ns - TAIL * 1e9)
            place = body.position[row]
            offset = Rotation.from_quat(np.atleast_2d(body.quaternion)[row]).apply([PLATE / 2, 0.0, 0.0])
            dot.set_data([place[self._shown[0]]], [place[self._shown[1]]])
            dot.set_markerfacecolor("white" if bridged.get(body.name) else dot.get_color())
            tail.set_data(*body.position[recent][:, self._shown].T)
            tail.set_linestyle(":" if bridged.get(body.name) else "-")
            plate.set_data(*np.stack([place - offset, place + offset])[:, self._shown].T)
            tips.append(place[self._shown])
        for (_, name), place in zip(self._marks, apart(np.array(tips), *self._letters), strict=True):
            name.set_position(tuple(place))


def apart(places: np.ndarray, wide: float, high: float) -> np.ndarray:
    """Return where names stand, shape (n, 2): above their places, and pushed up where they would cover each other.

    Args:
        places: Places that are named, y upwards, shape (n, 2) [mm or px]; names of unknown places, NaN, push none.
        wide: Width that a name takes, in the same unit.
        high: Height that a name takes.

    Example:
        >>> import numpy as np
        >>> from tacdata.viewers.pictures.hand_film import apart
        >>> apart(np.array([[0.0, 1.0], [5.0, 0.0]]), wide=26.0, high=8.0)[:, 1].round(1).tolist()
        [12.8, 4.8]
    """
    result = np.full_like(places, np.nan)
    put: list[np.ndarray] = []
    for k in np.argsort(places[:, 1], kind="stable"):
        if not np.isfinite(places[k]).all():
            continue
        at = places[k] + np.array([0.0, 0.6 * high])
        # From below upwards, so that a name only ever moves up.
        for neighbour in sorted(put, key=lambda entry: entry[1]):
            if abs(neighbour[0] - at[0]) < wide and abs(neighbour[1] - at[1]) < high:
                at[1] = neighbour[1] + high
        put.append(at)
        result[k] = at
    return result


def _finger(maps: DepthMaps) -> str:
    return maps.name.removeprefix("predicted ")


def _begin(scene: Scene) -> int:
    """Return the time of the first known fingertip [ns]."""
    return min(int(body.time_ns[0]) for body in scene.bodies)


def _color(number: int) -> tuple[float, ...]:
    return tuple(channel / 255 for channel in HUES[number % len(HUES)])


def _mark(axes: Axes, name: str, number: int) -> tuple[Any, Any]:
    """Return a dot and a name with a white rim, in the finger's colour."""
    rim = [withStroke(linewidth=2.5, foreground="white")]
    (dot,) = axes.plot([], [], "o", color=_color(number), markersize=6, markeredgewidth=1.5, zorder=3)
    words = axes.text(
        0, 0, name, fontsize=8, ha="center", va="bottom", color=_color(number), path_effects=rim, zorder=4
    )
    words.set_clip_on(True)
    return dot, words


def _opened(data: bytes) -> np.ndarray:
    """Return a JPEG image, uint8, shape (height, width, 3)."""
    from io import BytesIO

    from PIL import Image

    return np.asarray(Image.open(BytesIO(data)).convert("RGB"))


def _bridged_at(curves: Curves | None, time_ns: int) -> bool:
    """Return whether a path is a bridge at a time [ns]."""
    return curves is not None and len(curves.doubtful) > 0 and bool(curves.doubtful[nearest(curves.time_ns, time_ns)])


def _depth_curves(axes: Axes, scene: Scene, fingers: list[str]) -> Any:
    """Draw each finger's predicted depth over time, grey where any path is bridged; return the line at the time."""
    depth = next((c for c in scene.curves if c.name == "predicted depth"), None)
    zero, end = _begin(scene), max(int(body.time_ns[-1]) for body in scene.bodies)
    if depth:
        seconds = (depth.time_ns - zero) / 1e9
        for name, values in zip(depth.labels, depth.values.T, strict=True):
            axes.plot(seconds, values, color=_color(fingers.index(name)), linewidth=1.2, label=name)
    for curves in scene.curves:
        if curves.name.startswith("fingertip/") and len(curves.doubtful):
            shade_bridged(axes, (curves.time_ns - zero) / 1e9, curves.doubtful)
    axes.set(xlim=(0.0, (end - zero) / 1e9))
    axes.set_xlabel("time [s]; grey: a path is bridged", fontsize=8)
    axes.set_ylabel("predicted\ndepth [mm]" if depth else "no predicted\ndepth", fontsize=8)
    axes.tick_params(labelsize=7)
    if depth:
        axes.set_ylim(0.0, 1.3 * max(float(np.nanmax(depth.values, initial=0.0)), 0.1))  # room for names
        axes.legend(loc="upper right", fontsize=7, ncols=4, frameon=False)
    return axes.axvline(0.0, color="black", linewidth=1)
