"""Base class of an indenter's shape.

A file ``tacdata/indenters/my_shape.py`` defines one frozen dataclass derived from `Indenter`. Its fields are lengths
[mm] or angles [deg]; they are the shape's parameters in plans, recordings and labels.

Indenter frame: origin at the lowest point (a ring: at the middle of its lowest circle), z pointing away from the skin;
the solid fills z >= 0 around it.

Distance functions are Warp functions defined inside `Indenter.distance_function`, so that listing or reading plans
never imports Warp. Write ``wp = warp()`` in the function's body. That makes it a closure variable, by which Warp
resolves the annotations (strings, under ``from __future__ import annotations``).

Warp matches vector types by length and scalar, so ``wp.types.vector(8, wp.float64)`` may be written in every file.
Take lengths with ``wp.length``, not ``wp.sqrt``: its derivative at zero (points on the axis) is zero instead of NaN.
Kernels over a distance function need ``@wp.kernel(module="unique")``; otherwise each shape recompiles the others.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import MISSING, asdict, dataclass, fields
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tacdata import registry
from tacdata.errors import FormatError

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function

ROOM, BASE = "tacdata.indenters", "indenter"


@dataclass(frozen=True)
class Indenter(ABC):
    """Base class: a rigid shape that presses the skin."""

    def __post_init__(self) -> None:
        """Refuse parameters that are not positive and finite.

        Raises:
            FormatError: If a parameter is not positive and finite.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            is_number = isinstance(value, Real) and not isinstance(value, bool)
            if not (is_number and 0 < float(value) < np.inf):
                self._refuse(field.name, "a positive length [mm] or angle [deg]")

    def _refuse(self, name: str, allowed: str) -> None:
        """Raise the error of a parameter that makes no solid of this shape."""
        fault = f"indenter {self.shape}: {name} = {getattr(self, name)!r}"
        raise FormatError(fault, allowed, f"correct {name} in the plan or case")

    @classmethod
    @abstractmethod
    def example(cls) -> Self:
        """Return a typical example, fit to press a skin 3 mm thick; catalogues and conformance tests use it."""

    @property
    def shape(self) -> str:
        """The shape's name: its file's name."""
        return type(self).__module__.rsplit(".", 1)[-1]

    @property
    def document(self) -> dict[str, Any]:
        """The indenter as plain data: shape and parameters."""
        return {"shape": self.shape, **asdict(self)}

    @property
    @abstractmethod
    def parameters(self) -> tuple[float, ...]:
        """At most 8 numbers for the distance function, in mm or radians."""

    def device_parameters(self, device: str) -> tuple[float, ...]:
        """Return `parameters` for kernels on a device; data of a shape are copied there at the first call.

        Args:
            device: Warp's name of the device, for example "cuda:0".
        """
        return self.parameters

    @property
    def exactness(self) -> float:
        """Largest distance between the zero of the distance function and the shape [mm]; nearly 0 for closed forms."""
        return 1e-7

    @property
    def sharpest(self) -> float:
        """Smallest radius of curvature that may touch a skin [mm]; by default the shape's smallest length."""
        lengths = [value for name, value in asdict(self).items() if "angle" not in name]
        return min(float(value) for value in lengths if isinstance(value, int | float))

    @classmethod
    def complete(cls, values: dict[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
        """Return a document's parameters, completed by those that follow from others; a hook for shapes in files.

        Args:
            values: Parameters as given.
            origin: Their source, for errors.
            folder: Folder that file names are relative to; None if the document is in no file.
        """
        return values

    @staticmethod
    @abstractmethod
    def distance_function() -> Function:
        """Return a Warp function ``f(p: wp.vec3d, q: Parameters) -> wp.float64``.

        It gives the signed distance [mm] of point ``p`` [mm, indenter frame], negative inside the solid,
        where ``q`` is ``wp.types.vector(8, wp.float64)`` holding `parameters`. It must be continuous, exact
        near the surface, and the same object at every call (``@staticmethod @cache``), so that one compiled
        kernel serves every size.
        """

    @abstractmethod
    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height [mm] of the lower surface over (x, y) [mm]; ``inf`` outside the solid."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """Largest horizontal distance [mm] of the solid from its axis."""

    @property
    def height(self) -> float:
        """Height of the upright solid [mm]; ``inf`` where it goes on upward without end. A press cannot be deeper."""
        return np.inf

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return a surface for pictures [mm, indenter frame], cut at ``height`` [mm].

        The default samples `profile` and is open above. A shape returns a closed one where that is easy.
        """
        import trimesh

        x, y = self._grid()
        z = np.minimum(self.profile(x, y), height)
        lower = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        n = len(x)
        index = np.arange(n * n).reshape(n, n)
        a, b, c, d = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        faces = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3)
        inside = (lower[faces][:, :, 2] < height).any(axis=1)
        return trimesh.Trimesh(lower, faces[inside], process=True)

    def _grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Return sample positions that cover the solid [mm], two arrays of shape (65, 65)."""
        samples = np.linspace(-self.extent, self.extent, 65)
        x, y = np.meshgrid(samples, samples, indexing="ij")
        return x, y

    def footprint(self, depth: float, yaw: float) -> tuple[float, float]:
        """Return the extent of the part below ``depth`` [mm] along x and y [mm], for an indenter turned by ``yaw``
        [deg].
        """
        x, y = self._grid()
        within = self.profile(x, y) <= depth
        if not within.any():
            return 0.0, 0.0
        c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
        along_x, along_y = np.abs(c * x - s * y)[within].max(), np.abs(s * x + c * y)[within].max()
        return float(along_x), float(along_y)


def warp() -> Any:
    """Import Warp, typed as Any: the bodies of Warp functions are Python in form only."""
    from tacdata.warp_runtime import wp

    return wp


def rounded_hull(corners: np.ndarray, radius: float, height: float) -> trimesh.Trimesh:
    """Return the Minkowski sum of a convex polyhedron and a ball as a closed mesh, cut at ``height`` [mm].

    Args:
        corners: Corners of the polyhedron [mm], shape (n, 3).
        radius: Radius of the ball [mm].
        height: Where the cut is [mm].
    """
    import trimesh

    normals = np.asarray(trimesh.creation.icosphere(subdivisions=3).vertices)
    support = normals @ corners.T
    # The sum's surface point with a given normal is over the corner that is farthest along it.
    normal, corner = np.nonzero(support > support.max(axis=1, keepdims=True) - 1e-9)
    return cut(trimesh.convex.convex_hull(corners[corner] + radius * normals[normal]), height)


def cut(convex: trimesh.Trimesh, height: float) -> trimesh.Trimesh:
    """Return the part of a convex mesh below ``height`` [mm], closed again."""
    import trimesh

    if convex.bounds[1, 2] <= height:
        return convex
    points = np.asarray(convex.vertices)
    first, second = points[convex.edges_unique[:, 0]], points[convex.edges_unique[:, 1]]
    crossing = (first[:, 2] - height) * (second[:, 2] - height) < 0
    a, b = first[crossing], second[crossing]
    rim = a + (b - a) * ((height - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None]
    return trimesh.convex.convex_hull(np.vstack([points[points[:, 2] <= height], rim]))


def from_document(document: dict[str, Any], origin: str = "indenter", folder: Path | None = None) -> Indenter:
    """Build an indenter from ``{"shape": name, parameter: value, ...}``.

    Args:
        document: The indenter as plain data.
        origin: Its source, for errors.
        folder: Folder that file names in it are relative to.

    Raises:
        UsageError: If no such shape is known.
        FormatError: If a parameter is missing, unknown or not positive.

    Example:
        >>> from tacdata.indenters import from_document
        >>> cone = from_document({"shape": "cone", "half_angle": 45.0, "tip_radius": 0.5, "radius": 3.0})
        >>> cone.extent  # mm
        3.0
        >>> from_document({"shape": "cube"})
        Traceback (most recent call last):
            ...
        tacdata.errors.UsageError: 'cube' is not among the indenters
          allowed: cone, cylinder, ellipsoid, flat_punch, mesh, pair, prism, ring, sphere, square_punch
          next:    choose one, or add indenters/cube.py as a plug-in (docs/how_to/plug_ins.md)
    """
    values = dict(document)
    shape = values.pop("shape", None)
    if not isinstance(shape, str):
        shapes = ", ".join(registry.names(ROOM, BASE))
        raise FormatError(f"{origin}: no shape given", shapes, "add shape: NAME")
    kind: type[Indenter] = registry.load(ROOM, BASE, shape, Indenter)
    names = {f.name for f in fields(kind)}
    needed = {f.name for f in fields(kind) if f.default is MISSING}
    values = kind.complete(values, origin, folder)
    if not needed <= set(values) <= names:
        optional = sorted(names - needed)
        raise FormatError(
            f"{origin}: {shape} with {', '.join(sorted(values)) or 'no parameters'}",
            f"exactly {', '.join(sorted(needed))} (lengths in mm, angles in deg)"
            + (f"; {', '.join(optional)} if wanted" if optional else ""),
            "correct the parameters",
        )
    return kind(**values)
