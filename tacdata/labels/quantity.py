"""The quantities of a label and of a solved path: unit, shape, type in a file, and where they are absent."""

from __future__ import annotations

from dataclasses import dataclass

from tacdata.sensor.protrusion_pixels import PIXELS


@dataclass(frozen=True)
class Quantity:
    """An array of `Label` or `PathSolution`: its field's type annotation holds one.

    All lists of quantities follow from these annotations: columns of a label file, arrays of a stored path, the checks
    of both, quantities that a label takes over from its path, and columns that a dataset may have.
    """

    unit: str
    """Unit; "1" for a pure number."""
    kind: str
    """Shape of one row: scalar, vector, taxels, map, vector map or taxel maps."""
    dtype: str = "float32"
    """Type of a label's column; a stored path is in double precision."""
    needs: str = ""
    """Property of the sensor file without which it is None: "board", "spreads" or "transduction"; empty: none."""
    sparse: bool = False
    """Whether most values are 0, so that it is worth compressing."""

    def shape(self, rows: int, pixels: tuple[int, int], taxels: int) -> tuple[int, ...]:
        """Return the array's shape.

        Args:
            rows: Frames of a label, or states of a path.
            pixels: Pixels of a map along x and y.
            taxels: Number of taxels.
        """
        sizes = {
            "scalar": (),
            "vector": (3,),
            "taxels": (taxels,),
            "map": pixels,
            "vector map": (3, *pixels),
            "taxel maps": (taxels, PIXELS, PIXELS),
        }
        return (rows, *sizes[self.kind])
