"""What to show, as plain arrays. Backends draw a `Scene`; nothing here knows how.

Lengths are in mm in the sensor's frame, times in ns on the host's clock; a camera's poses are in its own
frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewers.color_scale import ColorScale

UNKNOWN = 160
"""Grey level of a skin whose depth is not known."""


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

    @property
    def grid(self) -> np.ndarray:
        """The signal as a picture of the array, shape (n, rows, columns): rows along y, columns along x."""
        return self.values.reshape(len(self.values), self.rows, self.columns)


@dataclass(frozen=True)
class DepthMaps:
    """Maps on the label's pixel grid."""

    name: str
    """"label", "prediction" or "error"."""
    x: np.ndarray
    """Pixel centres along x [mm], shape (pixels_x,)."""
    y: np.ndarray
    """Pixel centres along y [mm], shape (pixels_y,)."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    values: np.ndarray
    """Depth, or predicted minus labelled depth [mm], shape (n, pixels_x, pixels_y), float32."""
    scale: ColorScale

    @property
    def pictures(self) -> np.ndarray:
        """The maps as pictures, shape (n, pixels_y, pixels_x): x to the right, y up from the last row."""
        return self.values.transpose(0, 2, 1)[:, ::-1]

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return where points x, y [mm], shape (n, 2 or more), lie in `pictures` [px], shape (n, 2).

        The upper left corner of the upper left pixel is (0, 0).
        """
        across = (points[:, 0] - self.x[0]) / (self.x[1] - self.x[0]) + 0.5
        down = len(self.y) - 0.5 - (points[:, 1] - self.y[0]) / (self.y[1] - self.y[0])
        return np.stack([across, down], axis=-1)


@dataclass(frozen=True)
class Surface:
    """The skin's outer face at the pixel centres."""

    name: str
    """"label", "prediction" or "undeformed"."""
    x: np.ndarray
    """Pixel centres along x [mm], shape (pixels_x,)."""
    y: np.ndarray
    """Pixel centres along y [mm], shape (pixels_y,)."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64; one entry for a face that does not move."""
    height: np.ndarray
    """z of the face [mm], shape (n, pixels_x, pixels_y), float32."""
    depth: np.ndarray
    """What colours it [mm], shape (n, pixels_x, pixels_y), float32."""
    scale: ColorScale

    @property
    def colors(self) -> np.ndarray:
        """Colours of the vertices, shape (n, pixels_x * pixels_y, 3), uint8; grey where no depth is known."""
        if self.name == "undeformed":
            return np.full((len(self.depth), self.depth[0].size, 3), UNKNOWN, dtype=np.uint8)
        return self.scale.rgb(self.depth).reshape(len(self.depth), -1, 3)

    @property
    def faces(self) -> np.ndarray:
        """Triangles over the vertices in C order, shape (m, 3), int64, counter-clockwise seen from +z."""
        index = np.arange(len(self.x) * len(self.y)).reshape(len(self.x), len(self.y))
        a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
        return np.concatenate(
            [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
        )

    @property
    def vertices(self) -> np.ndarray:
        """Vertices [mm], shape (n, pixels_x * pixels_y, 3), float32."""
        plane = np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1).astype(np.float32)
        plane = np.broadcast_to(plane, (len(self.height), *plane.shape))
        return np.concatenate([plane, self.height[..., None]], axis=-1).reshape(len(self.height), -1, 3)


@dataclass(frozen=True)
class Body:
    """A rigid body that moves without turning."""

    name: str
    vertices: np.ndarray
    """Vertices in the body's frame [mm], shape (v, 3)."""
    faces: np.ndarray
    """Triangles, shape (m, 3), int64."""
    quaternion: tuple[float, float, float, float]
    """Orientation in the sensor's frame, xyzw [1]."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    position: np.ndarray
    """Origin of the body's frame in the sensor's frame [mm], shape (n, 3)."""


@dataclass(frozen=True)
class CameraView:
    """What one camera saw, and where it saw the cube."""

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
    """What a person reads first, as Markdown; includes what is missing."""
    frame_ns: np.ndarray
    """Sample time of every taxel frame [ns], shape (n,), int64."""
    frame: np.ndarray
    """The device's counter of every taxel frame [frames], shape (n,), int64."""
    footprint: np.ndarray
    """Corners of the skin's block: minimum and maximum x, y, z [mm], shape (2, 3)."""
    curves: tuple[Curves, ...]
    taxels: TaxelArray
    tip: Curves | None
    """Nominal x, y, depth of the indenter's lowest point [mm], or None if unknown."""
    maps: tuple[DepthMaps, ...]
    surfaces: tuple[Surface, ...]
    bodies: tuple[Body, ...]
    cameras: tuple[CameraView, ...]
    phases: tuple[Span, ...]

    def frame_at(self, time_ns: np.ndarray) -> np.ndarray:
        """Return the counter of the last taxel frame sampled by times [ns], shape (n,).

        Times before the first frame get the first one's counter.
        """
        index = np.searchsorted(self.frame_ns, time_ns, side="right") - 1
        return self.frame[np.clip(index, 0, len(self.frame) - 1)]

    def map_named(self, name: str) -> DepthMaps | None:
        """Return the maps called ``name``, or None."""
        return next((m for m in self.maps if m.name == name), None)
