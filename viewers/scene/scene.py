"""A scene: everything that is shown, as plain arrays. Backends decide how it looks.

Lengths are in mm, in the sensor's frame or, for fingers, in that of the demonstration; times in ns on the host's
clock; a camera's poses are in its own frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.viewers.scene.color_scale import ColorScale
from tacdata.viewers.scene.space import Body, Cloud, MotionTrail, SkinSurface

__all__ = [
    "Bars",
    "Body",
    "CameraView",
    "Cloud",
    "Curves",
    "DepthMaps",
    "MotionTrail",
    "Page",
    "Scene",
    "SkinSurface",
    "Span",
    "TaxelArray",
]


FIRST_HOST_TIME = 10**17
"""Times before 1973 are no host's clock [ns]."""


@dataclass(frozen=True)
class Curves:
    """Quantities over time that share a unit."""

    name: str
    """Path-like name, for example "taxels/change"."""
    unit: str
    labels: tuple[str, ...]
    """One name a curve."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64, increasing."""
    values: np.ndarray
    """Values [unit], shape (n, curves); NaN where nothing was measured."""
    doubtful: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    """Where they are bridged and not measured, shape (n,), bool; empty where none is."""


@dataclass(frozen=True)
class TaxelArray:
    """The taxels as small bodies coloured by their signal."""

    centers: np.ndarray
    """Taxel centres on the plane z = 0 [mm], shape (taxels, 3)."""
    radius: float
    """Radius of a protrusion [mm]."""
    columns: int
    """Taxels along x."""
    rows: int
    """Taxels along y."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    values: np.ndarray
    """Signal [the scale's unit], shape (n, taxels); taxel k = i + columns * j."""
    scale: ColorScale
    name: str = ""
    """Name of the finger that wears it; empty for the one sensor of a press."""

    @property
    def grid(self) -> np.ndarray:
        """The signal as a picture of the array, shape (n, rows, columns): rows along y, columns along x."""
        return self.values.reshape(len(self.values), self.rows, self.columns)


@dataclass(frozen=True)
class DepthMaps:
    """Maps on the label's pixel grid."""

    name: str
    """"label", "prediction", "error", "pressure", "shear", "board", or a comparison's name for it."""
    x: np.ndarray
    """Pixel centres along x [mm], shape (pixels_x,)."""
    y: np.ndarray
    """Pixel centres along y [mm], shape (pixels_y,)."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    values: np.ndarray
    """Depth, or predicted minus labelled depth [mm], or a traction [kPa], shape (n, pixels_x, pixels_y), float32."""
    scale: ColorScale
    title: str = ""
    """Its heading; without one its name."""

    @property
    def pictures(self) -> np.ndarray:
        """The maps as pictures, shape (n, pixels_y, pixels_x): x to the right, y up from the last row."""
        return self.values.transpose(0, 2, 1)[:, ::-1]

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return where points x, y [mm], shape (n, 2 or more), lie in `pictures` [px], shape (n, 2).

        The upper left corner of the upper left pixel is (0, 0).
        """
        columns = (points[:, 0] - self.x[0]) / (self.x[1] - self.x[0]) + 0.5
        rows = len(self.y) - 0.5 - (points[:, 1] - self.y[0]) / (self.y[1] - self.y[0])
        return np.stack([columns, rows], axis=-1)


@dataclass(frozen=True)
class Bars:
    """Numbers with names, in no order of time."""

    name: str
    title: str
    """Compared quantity, with the unit."""
    labels: tuple[str, ...]
    values: np.ndarray
    """In the unit of the title [1], shape (n,); NaN where there is none."""
    mark: float | None = None
    """A value worth a line: a threshold or a floor."""
    logarithmic: bool = False


@dataclass(frozen=True)
class Page:
    """A picture from another program in the folder of the data."""

    name: str
    title: str
    png: bytes


@dataclass(frozen=True)
class CameraView:
    """Images of one camera, and the cube's places in them."""

    name: str
    width: int
    """Image width [px]."""
    height: int
    """Image height [px]."""
    matrix: np.ndarray
    """Pinhole matrix [px], shape (3, 3)."""
    image_ns: np.ndarray
    """Times of exposure [ns], shape (n,), int64."""
    images: tuple[bytes, ...]
    """JPEG images."""
    cube_ns: np.ndarray
    """Times of the poses [ns], shape (p,), int64."""
    cube_position: np.ndarray
    """Cube origin in the camera's frame [mm], shape (p, 3); NaN where no tag was seen."""
    cube_quaternion: np.ndarray
    """Cube orientation in the camera's frame, xyzw [1], shape (p, 4)."""
    cube_side: float
    """Side of the cube [mm], and length of the axes that are drawn."""
    fingers: tuple[CameraView, ...] = ()
    """Fingertips seen in the same images, as views without images of their own."""
    pose: np.ndarray | None = None
    """The camera in the scene, homogeneous, shape (4, 4) [mm]; None if unknown."""

    def pixel(self, place: np.ndarray) -> np.ndarray | None:
        """Return the image coordinates [px], shape (2,), of a place in the scene [mm], shape (3,).

        Without the lens's distortion. None if it is behind the camera, or the camera's pose is not known.
        """
        if self.pose is None:
            return None
        x, y, z = self.matrix @ (self.pose[:3, :3].T @ (place - self.pose[:3, 3]))
        return np.array([x / z, y / z]) if z > 0 else None


@dataclass(frozen=True)
class Span:
    """A named stretch of time."""

    name: str
    start_ns: int
    """Beginning [ns]."""
    end_ns: int
    """End [ns]."""


@dataclass(frozen=True)
class Scene:
    """Everything that there is to see of one episode."""

    title: str
    summary: str
    """The summary, as Markdown; includes missing parts."""
    frame_ns: np.ndarray
    """Sample time of every taxel frame [ns], shape (n,), int64."""
    frame: np.ndarray
    """The device's counter of every taxel frame [frames], shape (n,), int64."""
    footprint: np.ndarray | None = None
    """Corners of the skin's block: minimum and maximum x, y, z [mm], shape (2, 3); None without one skin."""
    curves: tuple[Curves, ...] = ()
    arrays: tuple[TaxelArray, ...] = ()
    """The sensor's taxels; of a demonstration one entry for each finger with a board."""
    tip: Curves | None = None
    """Nominal x, y, depth of the indenter's lowest point [mm], or None if unknown."""
    maps: tuple[DepthMaps, ...] = ()
    surfaces: tuple[SkinSurface, ...] = ()
    bodies: tuple[Body, ...] = ()
    cameras: tuple[CameraView, ...] = ()
    phases: tuple[Span, ...] = ()
    notes: tuple[Span, ...] = ()
    """Intervals with a person's note."""
    trails: tuple[MotionTrail, ...] = ()
    clouds: tuple[Cloud, ...] = ()
    bars: tuple[Bars, ...] = ()
    pages: tuple[Page, ...] = ()
    kind: str = "episode"
    """Which layout it has: "episode", "hand", "verdict" or "comparison"."""
    device_ns: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """The board's own time of every taxel frame [ns], shape (n,), int64; empty without one."""

    @property
    def found(self) -> tuple[str, ...]:
        """The points of the summary as plain text, a line each."""
        lines = (line for line in self.summary.splitlines() if line.startswith("- "))
        return tuple(line.removeprefix("- ").replace("**", "") for line in lines)

    @property
    def taxels(self) -> TaxelArray:
        """The taxels of a press: the first array."""
        return self.arrays[0]

    @property
    def on_host_clock(self) -> bool:
        """Whether times are the host's; else they count from a beginning of their own."""
        return len(self.frame_ns) > 0 and int(self.frame_ns[0]) > FIRST_HOST_TIME

    @property
    def corners(self) -> np.ndarray:
        """Corners of the skin's block [mm], shape (2, 3); of a scene without one the taxels' own."""
        if self.footprint is not None:
            return self.footprint
        return np.stack([self.taxels.centers.min(axis=0), self.taxels.centers.max(axis=0)])

    def frame_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the counter of the last taxel frame sampled by times [ns], shape (n,).

        Times before the first frame get the first one's counter.
        """
        if not len(self.frame):
            return np.zeros(len(time_ns), dtype=np.int64)
        index = np.searchsorted(self.frame_ns, time_ns, side="right") - 1
        return self.frame[np.clip(index, 0, len(self.frame) - 1)]

    def device_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return times [ns] on the board's own clock, shape (n,), int64, interpolated between taxel frames."""
        # Relative to the first frame: as float64, Unix nanoseconds would be rounded to 240 ns.
        return np.interp(time_ns - self.frame_ns[0], self.frame_ns - self.frame_ns[0], self.device_ns).astype(np.int64)

    def map_named(self, name: str) -> DepthMaps | None:
        """Return the maps called ``name``, or None."""
        return next((m for m in self.maps if m.name == name), None)
