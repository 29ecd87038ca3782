"""The label of an episode, and the solved load path that it is interpolated from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class PathSolution:
    """Equilibria along one press: loading to the deepest point, then unloading. Content of one entry of the store."""

    depth: np.ndarray
    """Nominal depth of each state [mm], shape (k,); rises to its maximum, then falls; first and last are 0."""
    surface: np.ndarray
    """Undeformed minus deformed height of the outer face at the pixel centres [mm], shape (k, pixels_x, pixels_y).

    Signed: bulging is negative."""
    taxel_force: np.ndarray
    """Normal force carried by each protrusion [N], shape (k, taxels)."""
    taxel_closure: np.ndarray
    """Mean downward displacement over each protrusion's base [mm], shape (k, taxels)."""
    taxel_area: np.ndarray
    """Area of each protrusion in contact with the board, undeformed [mm^2], shape (k, taxels)."""
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (k, 3)."""
    numerical: np.ndarray
    """Estimated error of ``surface`` by the mesh alone [mm], shape (k, pixels_x, pixels_y); 0 if none was asked for."""
    force_error: np.ndarray
    """The same of ``force``, all components together [N], shape (k,)."""
    taxel_force_error: np.ndarray
    """The same of ``taxel_force`` [N], shape (k, taxels)."""
    residual: np.ndarray
    """Norm of the out-of-balance force over the contact force [1], shape (k,)."""
    penetration: np.ndarray
    """Largest penetration of the indenter at a contact point [mm], shape (k,)."""
    provenance: dict[str, Any]
    """What made it: key, sensor, material law, mesh, solver settings, code version, seconds."""


@dataclass(frozen=True)
class Label:
    """The depth maps of one episode, one per taxel frame."""

    episode: int
    """Number of the episode in its session."""
    time_ns: np.ndarray
    """Time of each frame [ns], shape (n,), int64: the recording's estimated sample times."""
    tip: np.ndarray
    """Nominal x, y and depth of the indenter's lowest point [mm], shape (n, 3)."""
    signed: np.ndarray
    """Undeformed minus deformed height of the outer face [mm], shape (n, pixels_x, pixels_y), float32.

    Signed: bulging is negative."""
    taxel_force: np.ndarray
    """Normal force carried by each protrusion [N], shape (n, taxels), float32."""
    taxel_closure: np.ndarray
    """Mean downward displacement over each protrusion's base [mm], shape (n, taxels), float32."""
    taxel_area: np.ndarray
    """Area of each protrusion in contact with the board, undeformed [mm^2], shape (n, taxels), float32."""
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (n, 3), float32."""
    error_map: np.ndarray
    """Estimated numerical error of each pixel [mm], shape (n, pixels_x, pixels_y), float16: three digits suffice.

    Root sum of squares of the bound on what is lost between states and of the error by the mesh; the spread of
    material, thickness and registration is not in it."""
    error: np.ndarray
    """Root mean square of ``error_map`` over the pixels [mm], shape (n,), float32."""
    force_error: np.ndarray
    """Estimated numerical error of ``force``, all components together [N], shape (n,), float32; made up alike."""
    provenance: dict[str, Any]
    """What made it: recording, path solution, sensor, code."""

    @property
    def depth(self) -> np.ndarray:
        """The label proper: the signed map clipped at 0 [mm], shape (n, pixels_x, pixels_y), float32."""
        return np.maximum(self.signed, 0.0)

