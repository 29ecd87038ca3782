"""Any closed solid, from an STL, OBJ, PLY or STEP file."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tacdata import provenance
from tacdata.errors import FormatError
from tacdata.indenters.indenter import Indenter, warp
from tacdata.surfaces import store
from tacdata.surfaces.solid import TOP, Solid, solid

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function

SHAPES = Path(__file__).parent / "shapes"
"""Surface files that ship."""

_SMALLEST, _LARGEST = 0.2, 200.0
"""Smallest and largest extent of a solid [mm]; others are files in another unit."""
_UNITS = {"metres": 1000.0, "inches": 25.4, "centimetres": 10.0, "micrometres": 1e-3}
"""Other units of surface files [mm]."""
_OFF_AXIS = 0.02
"""Minimum distance of the press axis from the border of the bounding box, over the box's size [1]."""


@dataclass(frozen=True)
class Mesh(Indenter):
    """A closed solid as in its file: z is the press's axis; its lowest point is moved to z = 0."""

    file: str = field(compare=False)
    """Name of the surface file, in the folder of the plan or case that names it; its content matters, not its name."""
    sha256: str
    """SHA-256 of the file (hex); computed if a plan or case leaves it out."""
    scale: float = 1.0
    """Millimetres in the file's unit [mm]: 1 for mm, 1000 for m, 25.4 for inches."""

    def __post_init__(self) -> None:
        """Refuse a wrong file name, hash or scale.

        Raises:
            FormatError: If a parameter is not of its kind.
        """
        if not isinstance(self.file, str) or not self.file.strip():
            self._refuse("file", "the name of an STL, OBJ or PLY file")
        if not isinstance(self.sha256, str) or len(self.sha256) != 64:
            self._refuse("sha256", "64 hexadecimal digits, or leave it out")
        number = isinstance(self.scale, int | float) and not isinstance(self.scale, bool)
        if not (number and 0 < self.scale < np.inf):
            self._refuse("scale", "a positive number of mm in the file's unit")

    @classmethod
    def complete(cls, values: dict[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
        """Find and check the file of a plan or case, store a copy, and add its hash.

        Raises:
            UsageError: If it is not found.
            FormatError: If it bounds no solid, has an impossible size, or is not the file of the hash given.
        """
        file, digest_given = values.get("file"), values.get("sha256")
        if not isinstance(file, str) or (digest_given and folder is None):
            return values
        path = next((p for p in ((folder or Path()) / file, SHAPES / file) if p.is_file()), (folder or Path()) / file)
        if digest_given and not path.is_file():
            return values
        digest = provenance.file_hash(path) if path.is_file() else ""
        if digest_given and digest != digest_given:
            raise FormatError(
                f"{origin}: {file} has changed: SHA-256 {digest[:12]}, {digest_given[:12]} is named",
                "the file that was named",
                "restore it, or remove sha256",
            )
        mesh = cls(Path(file).name, digest or "0" * 64, values.get("scale", 1.0))
        _check_size(solid(path, float(mesh.scale)), mesh, origin)
        _check_axis(solid(path, float(mesh.scale)), mesh, origin)
        store.keep(path)
        return {**values, "file": mesh.file, "sha256": digest}

    @classmethod
    def example(cls) -> Self:
        """Return a fingertip."""
        path = SHAPES / "fingertip.stl"
        return cls(path.name, provenance.file_hash(path))

    @property
    def solid(self) -> Solid:
        """The solid in the file.

        Raises:
            UsageError: If a file of that content is not on this machine.
        """
        shipped = SHAPES / Path(self.file).name
        if shipped.is_file() and provenance.file_hash(shipped) == self.sha256:
            return solid(shipped, float(self.scale))
        return solid(store.find(self.file, self.sha256, "indenter"), float(self.scale))

    @property
    def exactness(self) -> float:
        """Two micrometres [mm]: the error of the smooth surface behind a usual tessellation."""
        return 2e-3

    @property
    def sharpest(self) -> float:
        """Three tenths of a millimetre: a file does not state its sharpest edge, and its grid rounds finer ones."""
        return 0.3

    @property
    def parameters(self) -> tuple[float, ...]:
        """The address of the distance on the CPU, in two numbers."""
        return self.device_parameters("cpu")

    def device_parameters(self, device: str) -> tuple[float, ...]:
        """Return the address of the distance on a device; data are copied there at the first call."""
        return self.solid.handle(device)

    @property
    def extent(self) -> float:
        """Largest distance of a vertex from the z axis [mm], with a margin for the arcs between vertices."""
        vertices = np.asarray(self.solid.mesh.vertices)
        return 1.005 * float(np.hypot(vertices[:, 0], vertices[:, 1]).max())

    @property
    def height(self) -> float:
        """Height of the solid [mm]; a tall one goes on as a column (`tacdata.surfaces.solid.TOP`)."""
        top = float(self.solid.mesh.bounds[1, 2])
        return top if top < TOP else np.inf

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height at which vertical lines first meet the solid [mm]: sphere tracing, then bisection."""
        grid, top = self.solid.grid, float(self.solid.mesh.bounds[1, 2])
        plan = np.stack([np.ravel(x), np.ravel(y)], axis=-1).astype(float)
        z = np.full(len(plan), -grid.spacing)
        going, hits = np.arange(len(plan)), np.zeros(len(plan), dtype=bool)
        while len(going):
            d = grid.distance(np.column_stack([plan[going], z[going]]))
            hits[going[d < 0]] = True
            # No surface is nearer than the distance; a minimum step passes it where the line grazes it.
            z[going] += np.where(d < 0, 0.0, np.maximum(d, 0.25 * grid.spacing))
            going = going[(d >= 0) & (z[going] < min(top, grid.high[2]))]
        high = z[hits]
        low = high - 0.25 * grid.spacing
        for _ in range(40):
            middle = (low + high) / 2
            within = grid.distance(np.column_stack([plan[hits], middle])) < 0
            low, high = np.where(within, low, middle), np.where(within, middle, high)
        height = np.full(len(plan), np.inf)
        height[hits] = (low + high) / 2
        return height.reshape(np.shape(x))

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the spline of `tacdata.surfaces.distance_grid`, at the address in the parameters."""
        from tacdata.surfaces.distance_grid import MARGIN

        wp = warp()
        margin = wp.constant(wp.float64(MARGIN))

        @wp.func
        def weights(t: wp.float64):
            one, sixth = wp.float64(1.0), wp.float64(1.0) / wp.float64(6.0)
            s = one - t
            inner = wp.float64(3.0) * t * t * t - wp.float64(6.0) * t * t + wp.float64(4.0)
            outer = wp.float64(3.0) * s * s * s - wp.float64(6.0) * s * s + wp.float64(4.0)
            return wp.vec4d(sixth * s * s * s, sixth * inner, sixth * outer, sixth * t * t * t)

        @wp.func
        def mesh_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            zero, two, three = wp.float64(0.0), wp.float64(2.0), wp.float64(3.0)
            head = wp.array(ptr=wp.uint64(q[0]) * wp.uint64(16777216) + wp.uint64(q[1]), shape=(8,), dtype=wp.float64)
            nx, ny, nz = wp.int32(head[5]), wp.int32(head[6]), wp.int32(head[7])
            c = wp.array(ptr=wp.uint64(head[0]), shape=(nx, ny, nz), dtype=wp.float32)
            h = head[4]
            wx, wy, wz = (p[0] - head[1]) / h, (p[1] - head[2]) / h, (p[2] - head[3]) / h
            gx = wp.clamp(wx, two, head[5] - three)
            gy = wp.clamp(wy, two, head[6] - three)
            gz = wp.clamp(wz, two, head[7] - three)
            i = wp.min(wp.int32(gx), nx - 3)
            j = wp.min(wp.int32(gy), ny - 3)
            k = wp.min(wp.int32(gz), nz - 3)
            a, b, e = weights(gx - wp.float64(i)), weights(gy - wp.float64(j)), weights(gz - wp.float64(k))
            d = zero
            for r in range(4):
                for s in range(4):
                    line = zero
                    for n in range(4):
                        line += e[n] * wp.float64(c[i - 1 + r, j - 1 + s, k - 1 + n])
                    d += a[r] * b[s] * line
            outside = h * wp.length(wp.vec3d(wx - gx, wy - gy, wp.min(wz - gz, zero)))
            if outside > zero:
                # Two lower bounds: by way of the box of the grid, and the distance from the box of the solid.
                inset = margin / h
                sx = wx - wp.clamp(wx, two + inset, head[5] - three - inset)
                sy = wy - wp.clamp(wy, two + inset, head[6] - three - inset)
                sz = wp.min(wz - (two + inset), zero)
                d = wp.max(wp.length(wp.vec2d(wp.max(d, zero), outside)), h * wp.length(wp.vec3d(sx, sy, sz)))
            return d

        return mesh_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return the solid as tessellated, cut at ``height`` [mm]."""
        import trimesh

        body = self.solid.mesh
        low, high = body.bounds
        if high[2] <= height:
            return body.copy()
        below = trimesh.creation.box(bounds=[low - 1.0, [high[0] + 1.0, high[1] + 1.0, height]])
        part = trimesh.boolean.intersection([body, below], engine="manifold")
        vertices = np.asarray(part.vertices).copy()
        # The intersection is computed in single precision.
        vertices[np.abs(vertices[:, 2] - height) < 1e-5, 2] = height
        return trimesh.Trimesh(vertices, part.faces, process=False)


def _check_size(body: Solid, indenter: Mesh, origin: str) -> None:
    extents = np.asarray(body.mesh.extents)
    if extents.max() < _SMALLEST or extents.min() > _LARGEST or extents.max() > 10 * _LARGEST:
        size = " x ".join(f"{v:.3g}" for v in extents)
        fitting = [
            f"{scale * indenter.scale:g} ({unit})"
            for unit, scale in _UNITS.items()
            if _SMALLEST <= scale * extents.max() <= _LARGEST
        ]
        raise FormatError(
            f"{origin}: {indenter.file} is {size} mm with scale {indenter.scale:g}",
            f"an indenter of {_SMALLEST:g} to {_LARGEST:g} mm",
            "if the file is in another unit, give scale: " + (" or ".join(fitting) or "its unit in mm"),
        )


def _check_axis(body: Solid, indenter: Mesh, origin: str) -> None:
    """Refuse a solid away from the axis along which it is pressed, as in a file of a whole build plate.

    The axis may pass between two tips of one holder. So it must meet the bounding box, not the solid.
    """
    low, high = np.asarray(body.mesh.bounds)[:, :2]
    inset = _OFF_AXIS * (high - low)
    if np.any(low + inset > 0) or np.any(high - inset < 0):
        middle = (low + high) / 2
        away = ", ".join(f"{0.0 - m:.4g}" for m in np.round(middle, 6))
        raise FormatError(
            f"{origin}: {indenter.file} spans x {low[0]:.4g} to {high[0]:.4g} mm and y {low[1]:.4g} to {high[1]:.4g} "
            f"mm: the press axis, x = y = 0, passes beside it",
            "a solid around the z axis, along which it is pressed",
            f"move it by ({away}) mm in the CAD file, or wherever its tip's axis is",
        )
