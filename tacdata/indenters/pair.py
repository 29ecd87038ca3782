"""Two solids of any shapes on one holder: two contacts at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.indenters.indenter import BASE, ROOM, Indenter, from_document, warp

if TYPE_CHECKING:
    import trimesh

    from tacdata.warp_runtime import Function

_MEMBERS = ("first", "second")


@dataclass(frozen=True)
class Pair(Indenter):
    """Two solids with their lowest points at the same height, side by side along x; the press's yaw turns both.

    Example:
        >>> from tacdata.indenters import from_document
        >>> ball = {"shape": "sphere", "radius": 1.5}
        >>> pair = from_document({"shape": "pair", "first": ball, "second": ball, "distance": 4.0})
        >>> pair.extent  # mm
        3.5
    """

    first: Indenter
    """Solid at x = -distance / 2: a shape with its sizes [mm, deg]."""
    second: Indenter
    """Solid at x = +distance / 2: a shape with its sizes [mm, deg]."""
    distance: float
    """Distance between the two solids' axes [mm]."""

    def __post_init__(self) -> None:
        """Refuse members that are no solids, and a distance that is none.

        Raises:
            FormatError: If so.
        """
        for name in _MEMBERS:
            if not isinstance(getattr(self, name), Indenter) or isinstance(getattr(self, name), Pair):
                self._refuse(name, "a shape with its sizes, no pair itself")
        value = self.distance
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (number and 0 < value < np.inf):
            self._refuse("distance", "a positive length [mm]")

    @classmethod
    def complete(cls, values: dict[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
        """Build the two solids of a document.

        Raises:
            UsageError: If one is of no known shape.
            FormatError: If one is none.
        """
        complete = dict(values)
        for name in _MEMBERS:
            if isinstance(values.get(name), dict):
                if values[name].get("shape") == "pair":
                    raise FormatError(f"{origin}: {name} is a pair", "a single solid", "name two solids, not more")
                complete[name] = from_document(values[name], f"{origin}: {name}", folder)
        return complete

    @classmethod
    def example(cls) -> Self:
        """Return a ball and a punch, 5 mm apart."""
        ball, punch = {"shape": "sphere", "radius": 1.5}, {"shape": "flat_punch", "radius": 1.2, "edge_radius": 0.4}
        return cls(from_document(ball), from_document(punch), 5.0)

    @property
    def document(self) -> dict[str, Any]:
        """The pair as plain data."""
        members = {name: getattr(self, name).document for name in _MEMBERS}
        return {"shape": self.shape, **members, "distance": self.distance}

    @property
    def exactness(self) -> float:
        """That of the less exact solid [mm]."""
        return max(self.first.exactness, self.second.exactness)

    @property
    def sharpest(self) -> float:
        """That of the sharper solid [mm]."""
        return min(self.first.sharpest, self.second.sharpest)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The address of both solids' parameters on the CPU, in two numbers."""
        return self.device_parameters("cpu")

    def device_parameters(self, device: str) -> tuple[float, ...]:
        """Return the address of both solids' parameters on a device, in two numbers that single precision holds."""
        address = int(_on_device(self, device).ptr or 0)
        return float(address >> 24), float(address & 0xFFFFFF)

    @property
    def extent(self) -> float:
        """Distance of the farther solid from the holder's axis [mm]."""
        return self.distance / 2 + max(self.first.extent, self.second.extent)

    @property
    def height(self) -> float:
        """Height of the lower solid [mm]."""
        return min(self.first.height, self.second.height)

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the lower of the two profiles [mm]."""
        half = self.distance / 2
        return np.minimum(self.first.profile(x + half, y), self.second.profile(x - half, y))

    @staticmethod
    @cache
    def distance_function() -> Function:
        """Return the smaller of the two distances; each solid's own function is chosen by its number."""
        wp = warp()
        member, eight = _by_number(), wp.types.vector(8, wp.float64)

        @wp.func
        def pair_distance(p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
            rows = wp.array(ptr=wp.uint64(q[0]) * wp.uint64(16777216) + wp.uint64(q[1]), shape=(3,), dtype=eight)
            head = rows[0]
            side = wp.vec3d(head[0], wp.float64(0.0), wp.float64(0.0))
            return wp.min(member(head[1], p + side, rows[1]), member(head[2], p - side, rows[2]))

        return pair_distance

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return both surfaces, joined where they overlap."""
        import trimesh

        parts = []
        for member, place in ((self.first, -self.distance / 2), (self.second, self.distance / 2)):
            part = member.surface(height)
            part.apply_translation([place, 0.0, 0.0])
            parts.append(part)
        if parts[0].bounds[1, 0] < parts[1].bounds[0, 0]:
            vertices = np.vstack([part.vertices for part in parts])
            faces = np.vstack([parts[0].faces, np.asarray(parts[1].faces) + len(parts[0].vertices)])
            return trimesh.Trimesh(vertices, faces, process=False)
        return trimesh.boolean.union(parts, engine="manifold")


def _shapes() -> list[str]:
    """Return the shapes that a pair may hold; their place in the list is their number."""
    return [name for name in registry.names(ROOM, BASE) if name != "pair"]


@cache
def _on_device(pair: Pair, device: str) -> Any:
    """Return half the distance, both solids' numbers and their parameters; kept, as kernels hold only the address."""
    from tacdata.warp_runtime import wp

    rows = np.zeros((3, 8))
    rows[0, 0] = pair.distance / 2
    for k, member in enumerate((pair.first, pair.second), start=1):
        parameters = member.device_parameters(device)
        rows[0, k], rows[k, : len(parameters)] = _shapes().index(member.shape), parameters
    return wp.array(rows, dtype=wp.types.vector(8, wp.float64), device=device)


def _by_number() -> Any:
    """Return a function of a shape's number, a point and parameters: a chain with one link for each shape."""
    wp = warp()
    chain: Any = None
    for number, name in reversed(list(enumerate(_shapes()))):
        kind: type[Indenter] = registry.load(ROOM, BASE, name, Indenter)
        function = kind.distance_function()
        # By a name of its own: Warp distinguishes functions by their names.
        chain = wp.func(_link(number, function, chain) if chain else _last(function), name=f"pair_{name}")
    return chain


def _link(number: int, function: Any, following: Any) -> Any:
    wp = warp()
    number_constant = wp.constant(wp.float64(number))

    def link(n: wp.float64, p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
        d = wp.float64(0.0)
        if n == number_constant:
            d = function(p, q)
        else:
            d = following(n, p, q)
        return d

    return link


def _last(function: Any) -> Any:
    wp = warp()

    def last(n: wp.float64, p: wp.vec3d, q: wp.types.vector(8, wp.float64)):
        return wp.float64(function(p, q))

    return last
