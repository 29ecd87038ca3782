"""The rigid shape under a depth map: where the skin touches, its surface is the shape's.

Contact closes gaps in the mean under each hat. Between nodes the mesh is inside the shape or off it, by some
micrometres. Heights above pixels are moved along the vertical:

- A point inside the shape comes down to its surface. No skin is inside a shape. So this never increases the error.
- A point off the shape goes up to it where all nodes around carry pressure. At the rim it goes a part of the way: the
  sum of the hats of nodes that carry pressure. A node counts the less the nearer its pressure is to none. So a node
  that barely touches, in one solution and not in the next, hardly moves the map. A node amid others that touch counts
  as they do.
- There no point stays below the shape's lowest: at a punch's edge a coarse mesh dips and lifts off. Where something
  bears the skin, this holds in every face with a node that touches. Skin that hangs in a frame may sag lower.

Sphere tracing finds the surface: a step as long as the distance never passes through it (Hart, The Visual Computer 12
(1996) 527). No point is above a shape: such states are refused (`tacdata.skin.contact.passage_check`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch

from tacdata.indenters import Indenter
from tacdata.warp_runtime import ON_CPU, wp

_Parameters = wp.types.vector(length=8, dtype=wp.float64)

_STEPS = wp.constant(100)
"""Steps of a trace at most; on a steep flank they shorten."""

_CLOSE = wp.constant(wp.float64(1e-6))
"""Distance at which a trace has arrived [mm]."""

_REACH = wp.constant(wp.float64(0.05))
"""Gap over which no point is raised [mm]; from half of it on, points are raised the less the wider it is."""

_FULL = wp.constant(wp.float64(0.1))
"""Sum of hats from which on no point stays below the shape's lowest [1]; below, it comes up in proportion."""

RIM_PRESSURE = 0.1
"""A node counts as touching in full from this share of the mean pressure on [1]; below, in proportion."""

_SIDES = ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0), (3, 4), (4, 5), (5, 3))
"""Sides of the four sub-triangles of a quadratic face, by its nodes."""


def touching_share(traction: np.ndarray, slots: np.ndarray) -> np.ndarray:
    """Return how far nodes count as touching [1], shape (s,), 0 to 1.

    A node in the midst of others that touch does as well. Under a flat face of a coarse mesh it is chance which nodes
    carry little or nothing. At the rim of the contact no node is amid others.

    Args:
        traction: On the indenter [MPa], shape (s, 3).
        slots: Contact nodes of each face, shape (f, 6).
    """
    size = np.linalg.norm(traction, axis=1)
    if not size.any():
        return size
    # The mean over the contact force: nodes that barely touch do not change it.
    share = np.minimum(size / (RIM_PRESSURE * (size**2).sum() / size.sum()), 1.0)
    # A mid-side node between two touching corners touches as well, though its hat may carry little force.
    smallest = np.ones_like(share)
    for a, b in _SIDES:
        np.minimum.at(smallest, slots[:, a], share[slots[:, b]])
        np.minimum.at(smallest, slots[:, b], share[slots[:, a]])
    return np.maximum(share, smallest)


def around(share: np.ndarray, slots: np.ndarray) -> np.ndarray:
    """Return the largest share of the nodes of a node's faces [1], shape (s,); arguments as of `touching_share`."""
    result = share.copy()
    np.maximum.at(result, slots, share[slots].max(axis=1, keepdims=True))
    return result


@cache
def _laying_kernel(distance: wp.Function) -> wp.Kernel:
    """Compile the kernel for one shape."""

    @wp.kernel(module="unique", module_options=ON_CPU, enable_backward=False)
    def laying(
        x: wp.array(dtype=wp.float64),
        y: wp.array(dtype=wp.float64),
        place: wp.vec3d,
        turn: wp.mat33d,
        size: _Parameters,
        lowest: wp.float64,
        share: wp.array2d(dtype=wp.float64),
        around: wp.array2d(dtype=wp.float64),
        height: wp.array2d(dtype=wp.float64),
    ):
        """Move heights (len(x), len(y)) onto the shape."""
        i, j = wp.tid()
        bare = wp.float64(height[i, j])
        z = bare
        way = wp.float64(1.0)
        back = wp.transpose(turn)
        gap = distance(back * (wp.vec3d(x[i], y[j], z) - place), size)
        inside = gap < wp.float64(0.0)
        if not inside:
            way = share[i, j]
            z = bare + wp.min(around[i, j] / _FULL, wp.float64(1.0)) * wp.max(lowest - bare, wp.float64(0.0))
            height[i, j] = z
        if way > wp.float64(0.0):
            shift = wp.float64(0.0)
            arrived = wp.int32(0)
            for _step in range(_STEPS):
                gap = distance(back * (wp.vec3d(x[i], y[j], z + shift) - place), size)
                if wp.abs(gap) < _CLOSE:
                    arrived = 1
                    break
                if shift + gap > _REACH:
                    break
                shift += gap
            # A steep flank may be out of reach: down, each step is right as far as it went, up none is.
            if arrived == 0 and not inside:
                shift = wp.float64(0.0)
            height[i, j] = z + way * shift * wp.clamp(
                wp.float64(2.0) * (wp.float64(1.0) - shift / _REACH), wp.float64(0.0), wp.float64(1.0)
            )

    return laying


@dataclass(frozen=True)
class PressedShape:
    """A rigid shape where it presses, and the nodes that it presses."""

    indenter: Indenter
    """The indenter."""
    place: np.ndarray
    """Place of its origin [mm], shape (3,)."""
    turn: np.ndarray
    """Rotation from its frame to the sensor's [1], shape (3, 3)."""
    lowest: float
    """Height of its lowest point [mm]."""
    touching: np.ndarray
    """How far each contact node of the outer face counts as touching [1], shape (s,): 0 to 1, ascending nodes."""
    around: np.ndarray
    """The same [1], shape (s,), of nodes where no point stays below the lowest; no less than `touching`."""

    def lay(self, x: wp.array, y: wp.array, height: torch.Tensor, share: torch.Tensor, around: torch.Tensor) -> None:
        """Move heights [mm], shape (len(x), len(y)), onto the shape.

        Args:
            x: Places along x [mm].
            y: Places along y [mm].
            height: Of the face; -1e30 where there is none.
            share: Sum of the hats by `touching`, shape (len(x), len(y)).
            around: Sum of the hats by `around`, likewise.
        """
        device = str(height.device)
        size = _Parameters(*np.pad(np.array(self.indenter.device_parameters(device)), (0, 8))[:8].tolist())
        wp.launch(
            _laying_kernel(self.indenter.distance_function()),
            dim=tuple(height.shape),
            inputs=[
                x,
                y,
                wp.vec3d(*self.place.tolist()),
                wp.mat33d(*self.turn.ravel().tolist()),
                size,
                self.lowest,
                wp.from_torch(share.contiguous()),
                wp.from_torch(around.contiguous()),
            ],
            outputs=[wp.from_torch(height)],
            device=device,
        )
