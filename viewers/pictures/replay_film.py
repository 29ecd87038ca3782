"""Replays of a grasp or wipe as a film: replays side by side, with the felt maps, forces and slip."""

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from matplotlib.patheffects import withStroke

from tacdata.replay.outcome import ReplayOutcome
from tacdata.replay.targets import FingertipTargets
from tacdata.viewers.output_file import FILMS, new_file
from tacdata.viewers.parts.maps import DEPTH_FLOOR
from tacdata.viewers.pictures.felt_maps import FeltMaps
from tacdata.viewers.pictures.film import MOST, RATE, write_film
from tacdata.viewers.pictures.hand_film import apart
from tacdata.viewers.pictures.page_frames import page_frames
from tacdata.viewers.pictures.panels import shade_bridged
from tacdata.viewers.pictures.replay_object import ReplayObjectShape
from tacdata.viewers.scene.color_scale import HUES, scale_of

WIDTH, MAPS, HEIGHT = 4.6, 2.3, 8.6
"""Widths of a replay and of the depth maps, and height of a frame [inch]."""
RESOLUTION = 80
"""Dots an inch."""
MARGIN = 25.0
"""Around all that moves [mm]."""
LINK: dict[str, Any] = {"colors": "0.45", "linewidths": 3.0, "capstyle": "round", "zorder": 1.5}
"""Drawing of a robot's links."""
MOST_SLIP = 5.0
"""Upper end of the slip's axis [mm]; an object that is lost slides farther."""
NAME = 0.46, 0.14
"""Width and height of a finger's name [inch]."""
LETTERS = 62
"""Letters of a line of the verdict."""
NAMES = {"direct": "direct", "compensated": "compensated, gains as given", "chosen": "compensated, gain found"}
"""Kind of replay -> its heading."""


def film_replays(path: Path, replays: Mapping[str, ReplayOutcome], targets: FingertipTargets) -> None:
    """Write a film of replays, by kind.

    Args:
        path: A new file that ends in .mp4 or .gif.
        replays: Kind -> its outcome.
        targets: The targets that were replayed: the predicted maps are their demonstration's.

    Raises:
        UsageError: If the file exists, has another ending, or films of its kind cannot be written here.
    """
    new_file(path, *FILMS)
    rate, longest = RATE[path.suffix], max(float(replay.time[-1]) for replay in replays.values())
    times = np.linspace(0.0, longest, min(max(round(longest * rate), 2), MOST[path.suffix]))
    write_film(path, page_frames(ReplayPage(replays, targets), times))


class ReplayPage:
    """All replays at one time: a column each, from the side and from above, forces and slip; the maps next to them."""

    def __init__(self, replays: Mapping[str, ReplayOutcome], targets: FingertipTargets) -> None:
        """Draw the beginning; arguments as in `film_replays`."""
        self._replays, self._gap = replays, targets.gap
        count = len(replays)
        self.figure = Figure(figsize=(WIDTH * count + MAPS, HEIGHT), dpi=RESOLUTION)
        self.figure.set_layout_engine("constrained", rect=(0.0, 0.0, 0.995, 1.0))  # a margin at the right
        parts: Any = self.figure.subfigures(1, 2, width_ratios=[WIDTH * count, MAPS])
        ends = _ends(replays)
        inch = float(np.ptp(ends[:, 0])) / (WIDTH - 0.8)
        self._letters = NAME[0] * inch, NAME[1] * inch
        heights = [*(np.ptp(ends[:, up]) / np.ptp(ends[:, 0]) * 3.0 for up in (2, 1)), 1.2, 1.2]
        self._axes = parts[0].subplots(4, count, squeeze=False, height_ratios=heights)
        self._objects: dict[tuple[str, int], ReplayObjectShape] = {}
        self._pads: dict[tuple[str, int], list[tuple[Ellipse, Any]]] = {}
        self._links: dict[tuple[str, int], LineCollection] = {}
        self._curves: list[ReplayCurves] = []
        # After the verdict empty fingers may hit anything: their force would flatten the curves before it.
        forces = [replay.path.force[replay.time <= replay.decided].max() for replay in replays.values()]
        force_limit = 1.3 * float(max(forces)) + 0.1
        for column, (kind, replay) in enumerate(replays.items()):
            for row, up in enumerate((2, 1)):
                axes = self._axes[row, column]
                axes.set(xlim=ends[:, 0], ylim=ends[:, up], aspect="equal")
                axes.set_ylabel(("side: z" if up == 2 else "above: y") + " [mm]", fontsize=8)
                self._objects[kind, up] = ReplayObjectShape(axes, replay, up)
                self._links[kind, up] = axes.add_collection(LineCollection([], **LINK), autolim=False)
                self._pads[kind, up] = [_pad(axes, name, k) for k, name in enumerate(replay.fingers)]
            self._axes[1, column].set_xlabel("x [mm]", fontsize=8)
            for row, name, values, top in (
                (2, "normal force [N]", replay.path.force, force_limit),
                (3, "slip [mm]", 1000 * replay.path.slip, MOST_SLIP),
            ):
                curves = ReplayCurves(self._axes[row, column], replay, name, values, top, self._gap)
                self._curves.append(curves)
            self._axes[2, column].legend(loc="upper left", fontsize=7, ncols=4, frameon=False)
            self._axes[3, column].set_xlabel("time [s]", fontsize=8)
            for axes in self._axes[:, column]:
                axes.tick_params(labelsize=7)
        self._maps = _felt_maps(parts[1], targets)
        self._fingers = targets.fingers
        self.show(0.0)

    def show(self, time: float) -> None:
        """Move everything to where it was at a time since the beginning [s]."""
        for curves in self._curves:
            curves.show(time)
        for column, (kind, replay) in enumerate(self._replays.items()):
            row = min(int(np.searchsorted(replay.time, time)), len(replay.time) - 1)
            for up in (2, 1):
                self._objects[kind, up].show(row)
                self._links[kind, up].set_segments(list(1000 * replay.path.links[row][..., [0, up]]))
                places = 1000 * replay.path.tips[row][:, [0, up]]
                shapes = 1e6 * replay.path.pads[row][:, [0, up]][..., [0, up]]
                names = apart(places + np.sqrt(shapes[:, 1, 1])[:, None] * (0.0, 0.5), *self._letters)
                for k, (pad, name) in enumerate(self._pads[kind, up]):
                    _place(pad, places[k], shapes[k])
                    pad.set_fill(not self._gap[row, k])
                    name.set_position(tuple(names[k]))
            verdict = replay.reason if time >= replay.decided else ""
            title = f"{NAMES.get(kind, kind)}\n{time:.1f} s, {_moved(replay, row)}\n"
            self._axes[0, column].set_title(title + _two_lines(verdict), fontsize=9, loc="left")
        row = min(int(np.searchsorted(replay.time, time)), len(replay.time) - 1)
        bridged = [name for name, gap in zip(self._fingers, self._gap[row], strict=True) if gap]
        self._maps.show(dict.fromkeys(self._fingers, row), bridged)


def _felt_maps(figure: Any, targets: FingertipTargets) -> FeltMaps:
    """Draw the maps of the demonstration that is replayed; none for targets without predicted depth."""
    tracks = targets.source.tracks if targets.source else {}
    depth = {name: tracks[name].depth for name in targets.fingers if name in tracks}
    maps = {name: np.nan_to_num(np.asarray(d)[targets.rows]) for name, d in depth.items() if d is not None}
    deepest = np.array([max((float(values.max()) for values in maps.values()), default=0.0)])
    grids = {name: targets.source.sensors[name].map for name in maps} if targets.source else {}
    felt = {name: (maps[name], grid.x, grid.y) for name, grid in grids.items()}
    return FeltMaps(figure, felt, scale_of(deepest, "mm", floor=DEPTH_FLOOR))


def _two_lines(words: str) -> str:
    lines = fill(words, LETTERS).splitlines()[:2]
    return "\n".join([*lines, *[" "] * (2 - len(lines))])


def _place(pad: Ellipse, place: np.ndarray, shape: np.ndarray) -> None:
    """Draw the outline of a pad [mm] whose shape, seen along an axis, is [mm^2], shape (2, 2)."""
    squares, axes = np.linalg.eigh(shape)
    pad.set_center(tuple(place))
    pad.width, pad.height = 2 * np.sqrt(squares)
    pad.angle = float(np.degrees(np.arctan2(axes[1, 0], axes[0, 0])))


def _pad(axes: Axes, finger: str, number: int) -> tuple[Ellipse, Any]:
    color = tuple(channel / 255 for channel in HUES[number % len(HUES)])
    pad = Ellipse((0, 0), 1, 1, facecolor=color, edgecolor=color, alpha=0.8, zorder=2)
    axes.add_patch(pad)
    # A white rim keeps a name readable on top of the object or of another pad.
    rim = [withStroke(linewidth=2.0, foreground="white")]
    name = axes.text(0, 0, finger, fontsize=7, ha="center", va="bottom", color=color, path_effects=rim)
    return pad, name


def _moved(replay: ReplayOutcome, row: int) -> str:
    """Say how far the object has come: upwards, or over the board."""
    way = 1000 * (replay.path.centre[row] - replay.path.centre[0])
    if replay.scene.task == "wipe":
        return f"{replay.scene.name} moved by {np.linalg.norm(way[:2]):.0f} mm"
    return f"{replay.scene.name} lifted by {max(round(float(way[2])), 0)} mm"


class ReplayCurves:
    """A quantity of every pad over time, drawn up to now: the future must not show the end."""

    def __init__(
        self, axes: Axes, replay: ReplayOutcome, name: str, values: np.ndarray, limit: float, gap: np.ndarray
    ) -> None:
        """Draw the axes, grey where a path is bridged."""
        self._replay, self._values = replay, values
        self._lines = [
            axes.plot([], [], color=tuple(c / 255 for c in HUES[k % len(HUES)]), linewidth=1.2, label=finger)[0]
            for k, finger in enumerate(replay.fingers)
        ]
        if gap.any():
            shade_bridged(axes, replay.time, np.any(gap, axis=1), label="path bridged")
        axes.set(xlim=(replay.time[0], replay.time[-1]), ylim=(0, limit))
        axes.set_ylabel(name, fontsize=8)
        self._now = axes.axvline(0.0, color="black", linewidth=1)
        self._lost = axes.axvspan(replay.decided, replay.time[-1], color="crimson", alpha=0.12, visible=False)
        self._word = axes.text(
            replay.decided, 0.6 * limit, " lost", fontsize=8, color="crimson", visible=False, clip_on=True
        )

    def show(self, time: float) -> None:
        """Draw up to a time since the beginning [s]."""
        rows = self._replay.time <= time
        for line, values in zip(self._lines, self._values.T, strict=True):
            line.set_data(self._replay.time[rows], values[rows])
        self._now.set_xdata([time, time])
        is_lost = not self._replay.held and time >= self._replay.decided
        self._lost.set_visible(is_lost)
        self._word.set_visible(is_lost)


def _ends(replays: Mapping[str, ReplayOutcome]) -> np.ndarray:
    """Return least and largest x, y and z of all that moves, with a margin [mm], shape (2, 3)."""
    places = np.concatenate([p.reshape(-1, 3) for r in replays.values() for p in (r.path.centre, r.path.tips)])
    reach = MARGIN + 1000 * max(max(replay.scene.body.sizes) for replay in replays.values())
    return np.stack([1000 * places.min(axis=0) - reach, 1000 * places.max(axis=0) + reach])
