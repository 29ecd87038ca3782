"""Objects of a scene in space, as plain arrays: skins, bodies, paths, clouds of points."""

from dataclasses import dataclass

import numpy as np

from tacdata.viewers.scene.color_scale import ColorScale

UNKNOWN = 160
"""Grey level of a skin whose depth is not known."""


@dataclass(frozen=True)
class SkinSurface:
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
    """Values of its colours [mm], shape (n, pixels_x, pixels_y), float32."""
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
        return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])

    @property
    def vertices(self) -> np.ndarray:
        """Vertices [mm], shape (n, pixels_x * pixels_y, 3), float32."""
        plane = np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1).astype(np.float32)
        plane = np.broadcast_to(plane, (len(self.height), *plane.shape))
        return np.concatenate([plane, self.height[..., None]], axis=-1).reshape(len(self.height), -1, 3)


@dataclass(frozen=True)
class Body:
    """A rigid body."""

    name: str
    vertices: np.ndarray
    """Vertices in the body's frame [mm], shape (v, 3)."""
    faces: np.ndarray
    """Triangles, shape (m, 3), int64."""
    quaternion: np.ndarray
    """Orientation in the scene's frame, xyzw [1]: shape (4,) of a body that does not turn, or (n, 4)."""
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    position: np.ndarray
    """Origin of the body's frame in the scene's frame [mm], shape (n, 3)."""
    axes: float = 0.0
    """Length of the axes drawn at its origin [mm]; 0 for none."""


@dataclass(frozen=True)
class MotionTrail:
    """The path of a point in space."""

    name: str
    position: np.ndarray
    """Places in the order of time [mm], shape (n, 3); NaN where it breaks off."""
    doubtful: np.ndarray
    """Where it is a bridge and no measurement, shape (n,), bool."""
    hue: int = 0
    """Which of `color_scale.HUES`."""
    faint: bool = False
    """Whether it is drawn pale, next to another path of the same hue."""

    def strips(self, doubtful: bool) -> list[np.ndarray]:
        """Return the stretches that are doubtful, or those that are not [mm], each of shape (m, 3), m >= 2."""
        valid = np.isfinite(self.position).all(axis=1)
        mask = valid & (self.doubtful == doubtful)
        if doubtful:  # a bridge begins and ends where the path is known
            mask = valid & (mask | np.roll(mask, 1) | np.roll(mask, -1))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
        return [self.position[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 2]


@dataclass(frozen=True)
class Cloud:
    """Points that change from time to time: where a skin is touched."""

    name: str
    time_ns: np.ndarray
    """Times [ns], shape (n,), int64."""
    count: np.ndarray
    """Points of each time, shape (n,), int64; 0 where nothing touches."""
    position: np.ndarray
    """Points of all times, one after another [mm], shape (count.sum(), 3)."""
    values: np.ndarray
    """Values of their colours [the scale's unit], shape (count.sum(),)."""
    scale: ColorScale
    radius: float = 0.2
    """At which a point is drawn [mm]."""
