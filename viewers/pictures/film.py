"""Draws a scene as a film (MP4 or GIF), without a display: skin, maps and signals as time goes by."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tacdata.errors import UsageError
from tacdata.extras import missing_package
from tacdata.viewers.backend import Backend
from tacdata.viewers.output_file import FILMS, new_file, written_beside
from tacdata.viewers.pictures import panels as panels
from tacdata.viewers.pictures.backend import STYLE
from tacdata.viewers.pictures.hand_film import HandPage, hand_times
from tacdata.viewers.pictures.page_frames import page_frames
from tacdata.viewers.pictures.skin import skin
from tacdata.viewers.scene.moments import nearest
from tacdata.viewers.scene.scene import Scene

RATE = {".mp4": 20.0, ".gif": 10.0}
"""Frames a second [Hz]."""
MOST = {".mp4": 240, ".gif": 60}
"""Frames of a film; longer recordings are shown faster."""
SIZE = (10.0, 5.6)
"""Of a frame [inch]."""


class FilmBackend(Backend):
    """One film an episode."""

    def __init__(self, path: Path, resolution: int = 80) -> None:
        """Take the file to write and its resolution [dots per inch].

        Raises:
            UsageError: If it exists or ends in neither .mp4 nor .gif.
        """
        self._path, self._resolution = new_file(path, *FILMS), resolution

    def draw(self, scene: Scene) -> None:
        """Write the film; a crash leaves none rather than half of one.

        Raises:
            UsageError: If the scene has neither a skin nor fingertips that move.
        """
        kind = self._path.suffix
        if scene.kind == "hand" and scene.bodies:
            with rc_context(STYLE):
                write_film(self._path, page_frames(HandPage(scene), hand_times(scene, RATE[kind], MOST[kind])))
            return
        if scene.kind != "episode":
            fault = f"a film of {scene.title}"
            allowed = "an episode of a recording, session or dataset, or a tracked demonstration"
            raise UsageError(fault, allowed, "use --picture or --save")
        times = film_times(scene, RATE[kind], MOST[kind])
        with rc_context(STYLE):
            write_film(self._path, self._frames(scene, times))

    def _frames(self, scene: Scene, times: np.ndarray) -> Iterator[np.ndarray]:
        for time in times.tolist():
            figure = frame(scene, time)
            canvas = FigureCanvasAgg(figure)
            figure.set_dpi(self._resolution)
            canvas.draw()
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def film_times(scene: Scene, rate: float, limit: int) -> np.ndarray:
    """Return the times of a film's frames [ns]: from approach to release if they are marked, else all of the episode.

    Args:
        scene: The episode.
        rate: Frames a second [Hz].
        limit: Frames at most.
    """
    begin, end = int(scene.frame_ns[0]), int(scene.frame_ns[-1])
    marked = [span for span in scene.phases if span.name != "rest"]
    if marked:
        # The rest before and after would be most of the film.
        begin, end = max(begin, marked[0].start_ns), min(end, max(span.end_ns for span in marked))
    count = int(np.clip((end - begin) / 1e9 * rate, 2, limit))
    return np.linspace(begin, end, count).astype(np.int64)


def frame(scene: Scene, time_ns: int) -> Figure:
    """Return one frame: the skin, the maps, the taxels, and the signals with a line at the time."""
    instants = (("deepest", time_ns),)
    figure = Figure(figsize=SIZE)
    parts: Any = figure.subfigures(1, 2, width_ratios=[1.25, 1])
    left, right = parts
    skin(left, scene, instants, bar=False)
    selection = [m for m in scene.maps if m.scale.unit == "mm" and not m.scale.signed][:2]
    axes = right.subplots(1 + len(selection) + 1, 1, height_ratios=[1.0] * (1 + len(selection)) + [0.9])
    right.subplots_adjust(left=0.16, right=0.97, top=0.94, bottom=0.1, hspace=0.55)
    taxels = scene.taxels
    centers = taxels.centers.reshape(taxels.rows, taxels.columns, 3)
    values = taxels.grid[nearest(taxels.time_ns, time_ns)]
    panels.image(axes[0], values, (centers[0, :, 0], centers[:, 0, 1]), taxels.scale)
    axes[0].set_title(f"Taxels, {taxels.scale.low:g} to {taxels.scale.high:g} {taxels.scale.unit}", fontsize=9)
    for panel, maps in zip(axes[1:], selection, strict=False):
        panels.image(panel, maps.values[nearest(maps.time_ns, time_ns)].T, (maps.x, maps.y), maps.scale)
        panels.tip_mark(panel, scene, time_ns)
        panel.set_title(f"{maps.name.capitalize()}: depth, 0 to {maps.scale.high:g} mm", fontsize=9)
    for panel in axes[:-1]:
        panel.set_ylabel("y [mm]", fontsize=8)
        panel.tick_params(labelsize=7)
    axes[-2].set_xlabel("x [mm]", fontsize=8)
    _signals(axes[-1], scene, time_ns)
    return figure


def _signals(axes: Any, scene: Scene, time_ns: int) -> None:
    change = next(c for c in scene.curves if c.name == "taxels/change")
    colors = panels.taxel_colors(scene.taxels.columns, scene.taxels.rows) / 255
    seconds = panels.seconds(scene, change.time_ns)
    for values, color in zip(change.values.T, colors, strict=True):
        axes.plot(seconds, values, color=tuple(color), linewidth=0.9)
    axes.axvline(float(panels.seconds(scene, np.array(time_ns))), color="black", linewidth=1.2)
    axes.set_xlim(seconds[0], seconds[-1])
    axes.set_xlabel("time [s]", fontsize=8)
    axes.set_ylabel(change.unit, fontsize=8)
    axes.tick_params(labelsize=7)


def write_film(path: Path, frames: Iterator[np.ndarray]) -> None:
    """Write frames, uint8, shape (height, width, 3) each, at the rate of the file's kind; whole or not at all.

    Raises:
        PackageError: If the package that writes such films is missing.
    """
    with written_beside(path) as temporary:
        write = _write_gif if path.suffix == ".gif" else _write_mp4
        write(temporary, frames, RATE[path.suffix])


def _write_gif(path: Path, frames: Iterator[np.ndarray], rate: float) -> None:
    from PIL import Image

    # Median cut, the default, spends its colours on large areas and loses those of the curves.
    how: dict[str, Any] = {"colors": 160, "method": Image.Quantize.MAXCOVERAGE, "dither": Image.Dither.NONE}
    pictures = [Image.fromarray(f).quantize(**how) for f in frames]
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=round(1000 / rate), loop=0, optimize=True
    )


def _write_mp4(path: Path, frames: Iterator[np.ndarray], rate: float) -> None:
    try:
        import av
    except ModuleNotFoundError as error:
        raise missing_package(error, "an MP4 film", "name a file that ends in .gif") or error from None

    with av.open(str(path), "w") as film:
        stream: Any = None
        for picture in frames:
            height, width = (2 * (n // 2) for n in picture.shape[:2])  # H.264 wants even numbers
            if stream is None:
                stream = film.add_stream("libx264", rate=round(rate))
                # 4:2:0, which every browser and phone plays.
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            film.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]))))
        film.mux(stream.encode())
