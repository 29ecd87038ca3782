"""What an indenter's file holds.

A file ``tacdata/indenters/my_shape.py`` defines one frozen dataclass derived from `Indenter`. Its fields are lengths
[mm] or angles [deg]; they are the shape's parameters in plans, recordings and labels. Indenter frame: origin at the
lowest point, z pointing away from the skin; the solid fills z >= 0 around the origin.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata import registry
from tacdata.errors import FormatError

if TYPE_CHECKING:
    import trimesh
    import warp as wp

ROOM, BASE = "tacdata.indenters", "indenter"


@dataclass(frozen=True)
class Indenter(ABC):
    """A rigid shape."""

    def __post_init__(self) -> None:
        """Refuse lengths that are no lengths.

        Raises:
            FormatError: If a parameter is not positive and finite.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, int | float) and not (np.isfinite(value) and value > 0):
                raise FormatError(
                    f"indenter {self.shape}: {field.name} = {value}",
                    "a positive length [mm] or angle [deg]",
                    f"correct {field.name} in the plan or case",
                )

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
        """At most 8 numbers handed to the distance function, in mm or radians."""

    @abstractmethod
    def distance_function(self) -> wp.Function:
        """Return a Warp function ``f(p: wp.vec3d, q: Parameters) -> wp.float64``.

        It gives the signed distance [mm] of point ``p`` [mm, indenter frame], negative inside the solid, where
        ``q`` is ``wp.types.vector(8, wp.float64)`` holding `parameters`. It must be continuous, exact near the
        surface, and defined in terms of ``q`` alone, so that one compiled kernel serves every size.
        """

    @abstractmethod
    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height [mm] of the lower surface above the lowest point at (x, y) [mm]; ``inf`` beside the solid."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """Largest horizontal distance [mm] of the solid from its axis."""

    def surface(self, height: float = 6.0) -> trimesh.Trimesh:
        """Return a closed surface for pictures [mm, indenter frame], cut off at ``height`` [mm].

        The default revolves or samples `profile`; a shape may return something better.
        """
        import trimesh

        samples = np.linspace(-self.extent, self.extent, 65)
        x, y = np.meshgrid(samples, samples, indexing="ij")
        z = np.minimum(self.profile(x, y), height)
        lower = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        n = len(samples)
        index = np.arange(n * n).reshape(n, n)
        a, b, c, d = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
        inside = (lower[faces][:, :, 2] < height).any(axis=1)
        return trimesh.Trimesh(lower, faces[inside], process=True)


def from_document(document: dict[str, Any], origin: str = "indenter") -> Indenter:
    """Build an indenter from ``{"shape": name, parameter: value, ...}``.

    Raises:
        UsageError: If no such shape is known.
        FormatError: If a parameter is missing, unknown or not positive.
    """
    values = dict(document)
    shape = values.pop("shape", None)
    if not isinstance(shape, str):
        raise FormatError(f"{origin}: no shape given", ", ".join(registry.names(ROOM, BASE)), "add shape: NAME")
    kind = registry.load(ROOM, BASE, shape, Indenter)
    wanted = {f.name for f in fields(kind)}
    if set(values) != wanted:
        raise FormatError(
            f"{origin}: {shape} with {', '.join(sorted(values)) or 'no parameters'}",
            f"exactly {', '.join(sorted(wanted))} (lengths in mm, angles in deg)",
            "correct the parameters",
        )
    return kind(**values)
