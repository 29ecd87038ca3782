"""Moves fingertip targets along their normals by the contact depth (paper, Tactile-Guided Compensation)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath

LARGEST = 10
"""Number of largest depths of a map whose mean is the scalar depth (paper)."""
DEFAULT = Path(__file__).with_name("gains.yaml")
MOST = 0.1
"""Largest plausible gain [m/mm]: 10 cm of target per millimetre felt. The paper's are near 0.01."""
LEAST = 1e-4
"""Smallest plausible gain [m/mm] that is not 0: 0.1 mm of target per millimetre felt."""


@dataclass(frozen=True)
class Gains:
    """Gain alpha of each task and finger: how far a target moves per millimetre of depth."""

    tasks: dict[str, dict[str, float]]
    """Task -> finger -> gain [m/mm]."""
    origin: str
    """Source of the gains, for messages."""

    def of(self, task: str) -> dict[str, float]:
        """Return the gain of each finger for a task [m/mm].

        Raises:
            UsageError: If there is no such task.
        """
        if task not in self.tasks:
            raise UsageError(
                f"no gains for task {task!r} in {self.origin}",
                ", ".join(self.tasks),
                "name one of them with --task, or add the task to a gains file",
            )
        return self.tasks[task]


def read_gains(path: StrPath | None = None) -> Gains:
    """Read a gains file (`schemas/gains.schema.json`); without a path, the paper's gains.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged, or a task has another number of gains than there are fingers.
    """
    path = None if path is None else Path(path)
    document = documents.read(path or DEFAULT, "gains")
    order = document["fingers"]
    for task, values in document["tasks"].items():
        if len(values) != len(order):
            fault = f"{path or DEFAULT}: tasks/{task}: {len(values)} gains"
            raise FormatError(fault, f"{len(order)}: {', '.join(order)}", "give every finger a gain, 0 for none")
        if (largest := max(map(float, values))) > MOST:
            raise FormatError(
                f"{path or DEFAULT}: tasks/{task}: a gain of {largest:g} m/mm, {1000 * largest:g} mm a millimetre felt",
                f"0 to {MOST:g} m/mm; the paper's are 0.004 to 0.012",
                "gains are metres for each millimetre: divide by 1000 if these are mm for each mm",
            )
        if (smallest := min((float(value) for value in values if value > 0), default=MOST)) < LEAST:
            raise FormatError(
                f"{path or DEFAULT}: tasks/{task}: a gain of {smallest:g} m/mm, {1000 * smallest:g} mm a mm felt",
                f"0, or {LEAST:g} to {MOST:g} m/mm; the paper's are 0.004 to 0.012",
                "gains are metres for each millimetre: multiply by 1000 if these are m for each um",
            )
    tasks = {task: dict(zip(order, map(float, values), strict=True)) for task, values in document["tasks"].items()}
    return Gains(tasks, str(path) if path else "the paper's gains")


def contact_depth(maps: np.ndarray) -> np.ndarray:
    """Return the contact depth d of each map: the mean of its ten largest depths [mm], shape (n,).

    Args:
        maps: Depth [mm], shape (n, pixels_x, pixels_y); a map with NaN gives NaN.

    Raises:
        FormatError: If a map has fewer than ten pixels.
    """
    flat = np.asarray(maps, float).reshape(len(maps), -1)
    if flat.shape[1] < LARGEST:
        raise FormatError(f"maps of {flat.shape[1]} pixels", f"at least {LARGEST}", "take the network's whole map")
    return np.partition(flat, -LARGEST, axis=1)[:, -LARGEST:].mean(axis=1)


def compensate(position: np.ndarray, normal: np.ndarray, depth: np.ndarray, gain: float) -> np.ndarray:
    """Return targets p + gain d n [m], shape (n, 3).

    Args:
        position: Fingertips as seen [m], shape (n, 3).
        normal: Unit normals towards the object [1], shape (n, 3).
        depth: Contact depth d [mm], shape (n,); NaN where nothing was felt; the target then stays.
        gain: alpha [m/mm].

    Raises:
        UsageError: If the gain is negative or not finite, or if shapes or normals do not fit.

    Example:
        >>> import numpy as np
        >>> from tacdata.demonstrations.compensation import compensate
        >>> seen, normal = np.array([[0.0, 0.0, 0.1]]), np.array([[0.0, 0.0, 1.0]])
        >>> compensate(seen, normal, depth=np.array([2.0]), gain=0.001)  # 2 mm felt, 1 mm per mm
        array([[0.   , 0.   , 0.102]])
    """
    if not np.isfinite(gain) or gain < 0:
        raise UsageError(f"a gain of {gain} m/mm", "0 or more", "correct the gains file")
    length = np.linalg.norm(normal, axis=1)
    if position.shape != normal.shape or len(depth) != len(position) or np.nanmax(np.abs(length - 1), initial=0) > 1e-3:
        raise UsageError(
            f"{len(position)} positions, {len(depth)} depths, normals of length {np.nanmin(length, initial=1):.3f}",
            "the same number of each, normals of length 1",
            "give fingertip poses with their depths",
        )
    # Without a predicted depth a target stays where it was seen.
    return position + gain * np.nan_to_num(np.asarray(depth, float))[:, None] * normal
