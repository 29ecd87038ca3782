"""The label of an episode, and the solved load path that it is interpolated from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from tacdata.display import Displayed
from tacdata.labels.quantity import Quantity

_OPTIONAL = ("traction", "taxel_pressure", "uncertainty", "taxel_capacitance", "taxel_counts")
"""Quantities that a description names where they are known."""


@dataclass(frozen=True, repr=False)
class PathSolution(Displayed):
    """Equilibria along one press: loading to the deepest point, then unloading. Content of one entry of the store."""

    depth: Annotated[np.ndarray, Quantity("mm", "scalar")]
    """Nominal depth of each state [mm], shape (k,); rises to its maximum, then falls; first and last are 0."""
    surface: Annotated[np.ndarray, Quantity("mm", "map")]
    """Undeformed minus deformed height of the outer face at the pixel centres [mm], shape (k, pixels_x, pixels_y).

    Signed: bulging is negative. Where the skin touches the indenter, the height is that of the indenter's surface."""
    numerical: Annotated[np.ndarray, Quantity("mm", "map")]
    """Estimated error of ``surface`` by the mesh alone [mm], shape (k, pixels_x, pixels_y); 0 if none was asked for."""
    taxel_force: Annotated[np.ndarray, Quantity("N", "taxels")]
    """Normal force carried by each protrusion [N], shape (k, taxels)."""
    taxel_force_error: Annotated[np.ndarray, Quantity("N", "taxels")]
    """Estimated error of ``taxel_force`` by the mesh alone [N], shape (k, taxels)."""
    taxel_closure: Annotated[np.ndarray, Quantity("mm", "taxels")]
    """Mean downward displacement over each protrusion's base [mm], shape (k, taxels)."""
    taxel_area: Annotated[np.ndarray, Quantity("mm^2", "taxels")]
    """Area of each protrusion in contact with the board, undeformed [mm^2], shape (k, taxels)."""
    force: Annotated[np.ndarray, Quantity("N", "vector")]
    """Force of the skin on the indenter [N], shape (k, 3)."""
    force_error: Annotated[np.ndarray, Quantity("N", "scalar")]
    """Estimated error of ``force`` by the mesh alone, all components together [N], shape (k,)."""
    residual: Annotated[np.ndarray, Quantity("1", "scalar")]
    """Norm of the out-of-balance force over the contact force [1], shape (k,)."""
    penetration: Annotated[np.ndarray, Quantity("mm", "scalar")]
    """Largest penetration of the indenter, as a mean under the hat of a contact node [mm], shape (k,)."""
    provenance: dict[str, Any]
    """Provenance: key, sensor, material law, mesh, solver settings, code version, seconds."""
    traction: Annotated[np.ndarray | None, Quantity("MPa", "vector map", sparse=True)] = None
    """Contact force on the indenter by area of the map, seen from above [MPa], shape (k, 3, pixels_x, pixels_y): z is
    pressure where the face is level, x and y are shear. Times a pixel's area it sums to ``force``. None in files of
    older releases."""
    taxel_pressure: Annotated[np.ndarray | None, Quantity("MPa", "taxel maps", needs="board", sparse=True)] = None
    """Pressure of each protrusion on the board, by area of its pixels (`tacdata.sensor.protrusion_pixels`) [MPa], shape
    (k, taxels, 10, 10). Times a pixel's area it sums to ``taxel_force``. None without a board, and in files of older
    releases."""
    status_steps: Annotated[np.ndarray | None, Quantity("1", "scalar")] = None
    """Newton steps since the state before after which contact had another status: a node opened, closed, stuck or
    slipped [count], shape (k,). None in files of older releases; so are the next."""
    equilibrium_steps: Annotated[np.ndarray | None, Quantity("1", "scalar")] = None
    """All other Newton steps since the state before [count], shape (k,)."""
    uncertainty: Annotated[np.ndarray | None, Quantity("mm", "map", needs="spreads")] = None
    """One standard deviation of ``surface`` by the spreads that the sensor file states [mm], shape (k, pixels_x,
    pixels_y); None if it states none or none was asked for. So are the three below."""
    force_uncertainty: Annotated[np.ndarray | None, Quantity("N", "vector", needs="spreads")] = None
    """The same of ``force`` [N], shape (k, 3)."""
    taxel_force_uncertainty: Annotated[np.ndarray | None, Quantity("N", "taxels", needs="spreads")] = None
    """The same of ``taxel_force`` [N], shape (k, taxels)."""
    taxel_closure_uncertainty: Annotated[np.ndarray | None, Quantity("mm", "taxels", needs="spreads")] = None
    """The same of ``taxel_closure`` [mm], shape (k, taxels)."""

    def description(self) -> Iterator[str]:
        """Yield its description: states, map, force, error."""
        states, *pixels = self.surface.shape
        yield f"PathSolution: {states} states down to {self.depth.max():g} mm, maps of {pixels[0]} × {pixels[1]} pixels"
        deepest = int(np.argmax(self.depth))
        yield f"normal force {self.force[deepest, 2]:.3g} N ± {self.force_error[deepest]:.2g} N by the mesh"
        yield f"map error by the mesh: {np.sqrt((self.numerical[deepest] ** 2).mean()):.2g} mm (root mean square)"
        optional = [name for name, value in vars(self).items() if value is not None and name in _OPTIONAL]
        yield f"with {', '.join(optional)}" if optional else "without tractions"


@dataclass(frozen=True, repr=False)
class Label(Displayed):
    """The depth maps of one episode, one per taxel frame.

    Example:
        >>> import tacdata as td
        >>> label = td.read_label("session/labels/episode-000000.parquet")
        >>> bool(label.depth.min() >= 0), label.time_ns.dtype
        (True, dtype('int64'))
    """

    episode: int
    """Number of the episode in its session."""
    time_ns: Annotated[np.ndarray, Quantity("ns", "scalar", "int64")]
    """Time of each frame [ns], shape (n,), int64: the recording's estimated sample times."""
    tip: Annotated[np.ndarray, Quantity("mm", "vector", "float64")]
    """Nominal x, y and depth of the indenter's lowest point [mm], shape (n, 3)."""
    signed: Annotated[np.ndarray, Quantity("mm", "map")]
    """Undeformed minus deformed height of the outer face [mm], shape (n, pixels_x, pixels_y), float32.

    Signed: bulging is negative. Where the skin touches the indenter, the height is that of the indenter's surface."""
    taxel_force: Annotated[np.ndarray, Quantity("N", "taxels")]
    """Normal force carried by each protrusion [N], shape (n, taxels), float32."""
    taxel_closure: Annotated[np.ndarray, Quantity("mm", "taxels")]
    """Mean downward displacement over each protrusion's base [mm], shape (n, taxels), float32."""
    taxel_area: Annotated[np.ndarray, Quantity("mm^2", "taxels")]
    """Area of each protrusion in contact with the board, undeformed [mm^2], shape (n, taxels), float32."""
    force: Annotated[np.ndarray, Quantity("N", "vector")]
    """Force of the skin on the indenter [N], shape (n, 3), float32."""
    error_map: Annotated[np.ndarray, Quantity("mm", "map", "float16")]
    """Estimated numerical error of each pixel [mm], shape (n, pixels_x, pixels_y), float16: three digits suffice.

    Root sum of squares of the bound on the interpolation error and of the error by the mesh; the spread of
    material, thickness and registration is not in it: that is ``uncertainty``."""
    error: Annotated[np.ndarray, Quantity("mm", "scalar")]
    """Root mean square of ``error_map`` over the pixels [mm], shape (n,), float32."""
    force_error: Annotated[np.ndarray, Quantity("N", "scalar")]
    """Estimated numerical error of ``force``, all components together [N], shape (n,), float32, in the same way."""
    provenance: dict[str, Any]
    """Provenance: recording, path solution, sensor, code."""
    traction: Annotated[np.ndarray | None, Quantity("MPa", "vector map", "float16")] = None
    """Contact force on the indenter by area of the map, seen from above [MPa], shape (n, 3, pixels_x, pixels_y),
    float16: z is pressure where the face is level, x and y are shear. None in labels of older releases."""
    taxel_pressure: Annotated[np.ndarray | None, Quantity("MPa", "taxel maps", "float16", needs="board")] = None
    """Pressure of each protrusion on the board, by area of its pixels (`tacdata.sensor.protrusion_pixels`) [MPa], shape
    (n, taxels, 10, 10), float16. None without a board, and in labels of older releases."""
    interpolation_error: Annotated[np.ndarray | None, Quantity("mm", "scalar")] = None
    """Largest distance of the states around each frame from the interpolation of their neighbours [mm], shape (n,),
    float32. A state is left out at twice the distance, so this bounds the error at the frame."""
    uncertainty: Annotated[np.ndarray | None, Quantity("mm", "map", "float16", needs="spreads")] = None
    """One standard deviation of each pixel by the spreads that the sensor file states [mm], shape (n, pixels_x,
    pixels_y), float16; None where the label knows of none. So are the three below."""
    force_uncertainty: Annotated[np.ndarray | None, Quantity("N", "vector", needs="spreads")] = None
    """The same of ``force`` [N], shape (n, 3), float32."""
    taxel_force_uncertainty: Annotated[np.ndarray | None, Quantity("N", "taxels", needs="spreads")] = None
    """The same of ``taxel_force`` [N], shape (n, taxels), float32."""
    taxel_closure_uncertainty: Annotated[np.ndarray | None, Quantity("mm", "taxels", needs="spreads")] = None
    """The same of ``taxel_closure`` [mm], shape (n, taxels), float32."""
    taxel_capacitance: Annotated[np.ndarray | None, Quantity("pF", "taxels", needs="transduction")] = None
    """Capacitance of each taxel that the sensor file's transduction makes of its loads [pF], shape (n, taxels),
    float32; None without a transduction in the file."""
    taxel_counts: Annotated[np.ndarray | None, Quantity("counts", "taxels", needs="transduction")] = None
    """The readings that go with it [counts], shape (n, taxels), float32: neither rounded nor noisy, not tared."""

    def description(self) -> Iterator[str]:
        """Yield its description: frames, map, force, error."""
        frames, *pixels = self.signed.shape
        yield f"Label of episode {self.episode}: {frames} maps of {pixels[0]} × {pixels[1]} pixels"
        yield f"deepest pixel {self.signed.max():.3g} mm, largest normal force {self.force[:, 2].max():.3g} N"
        yield f"numerical error up to {self.error.max():.2g} mm (root mean square over a map)"
        optional = [name for name, value in vars(self).items() if value is not None and name in _OPTIONAL]
        yield f"with {', '.join(optional)}" if optional else "without tractions and uncertainty"

    @property
    def deepest(self) -> np.ndarray:
        """The depth map of the frame with the deepest tip [mm], shape (pixels_x, pixels_y), float32."""
        return np.maximum(self.signed[int(np.argmax(self.tip[:, 2]))], 0.0)

    @property
    def depth(self) -> np.ndarray:
        """The label proper: the signed map clipped at 0 [mm], shape (n, pixels_x, pixels_y), float32."""
        return np.maximum(self.signed, 0.0)

    @property
    def dented(self) -> np.ndarray:
        """Pixels that lie deeper than a tenth of the nominal depth, in frames that touch, shape as `depth`, bool."""
        nominal = self.tip[:, 2, None, None]
        return (self.signed > 0.1 * nominal) & (nominal > 0)
