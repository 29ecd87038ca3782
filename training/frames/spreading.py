"""How a load spreads to the neighbours of a taxel: a diffusion on the grid of taxels, by one number.

A unit's skin may spread a load less far than the model's, or farther. The loads on the protrusions then differ by a
blur. Its kernel is that of heat: exp(variance / 2 times the Laplacian), which adds the variance along x and along y.
No load leaves the grid.
"""

from __future__ import annotations

import numpy as np

from tacdata.sensor.sensor import Taxels


def laplacian(taxels: Taxels) -> np.ndarray:
    """Return the Laplacian of loads on the grid [1/mm^2], shape (taxels, taxels), symmetric.

    Example:
        >>> from tacdata.sensor import default_sensor
        >>> from tacdata.training.frames.spreading import laplacian
        >>> round(float(abs(laplacian(default_sensor().taxels).sum(axis=1)).max()), 9)  # nothing is lost
        0.0
    """

    def along(count: int, pitch: float) -> np.ndarray:
        steps = np.diff(np.eye(count), axis=0) / pitch
        return -steps.T @ steps

    rows, columns = np.eye(taxels.rows), np.eye(taxels.columns)
    return np.kron(rows, along(taxels.columns, taxels.pitch_x)) + np.kron(along(taxels.rows, taxels.pitch_y), columns)


def spreading(taxels: Taxels, variance: float) -> np.ndarray:
    """Return the matrix that spreads loads, shape (taxels, taxels); a negative variance gathers them.

    Args:
        taxels: The grid.
        variance: By how much it grows a load's variance along each axis [mm^2].
    """
    values, modes = np.linalg.eigh(laplacian(taxels))
    return (modes * np.exp(variance / 2 * values)) @ modes.T
