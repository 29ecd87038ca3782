"""Which presses a table is solved on: places and depths that are the same for every session, so that presses are kept.

Places are multiples of a spacing from the array's centre, depths `UNIT` times squares: equally spaced in their root, as
loads at first touch ask for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import SolveError
from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.contact.press_limits import check_press
from tacdata.skin.press import PressRequest
from tacdata.surrogate.symmetry import foldable

EDGE = 2
"""Nodes beyond what is solved, at every end: splines are mirrored at the table's ends, and there it does no harm."""
MARGIN = 0.2
"""How far a table goes beyond the places pressed [mm]: effects move the tip."""
DEEPER = 0.1
"""How much deeper than the deepest press it goes [mm]."""
UNIT = 0.03
"""Depth of the first node [mm]."""
FEWEST = 5
"""Depths that are solved at least, the undeformed state included."""


@dataclass(frozen=True)
class Reach:
    """What one tool did: where and how deep."""

    indenter: Indenter
    yaw: float
    """How it was mounted [deg]."""
    low: tuple[float, float]
    """Least x and y [mm]."""
    high: tuple[float, float]
    """Largest x and y [mm]."""
    deepest: float
    """Largest depth [mm]."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """How far its axis leans about x and y [deg]."""


@dataclass(frozen=True)
class Grid:
    """Nodes of one table."""

    x: np.ndarray
    """[mm], shape (a,), equally spaced, `EDGE` of them at each end beyond what is solved."""
    y: np.ndarray
    """The same along y [mm], shape (b,)."""
    depth: np.ndarray
    """[mm], shape (d,), from 0, equally spaced in their root, `EDGE` of them beyond what is solved."""
    folded: bool
    """Whether the sensor looks the same from both sides, so that a quarter of the places is solved."""

    @property
    def states(self) -> int:
        """Number of depths solved."""
        return len(self.depth) - EDGE

    def presses(self, reach: Reach) -> list[tuple[int, int]]:
        """Return the nodes that are solved for a tool, by number along x and y: those around what it pressed."""
        i, j = (
            _near(axis, low, high, self.folded)
            for axis, low, high in zip((self.x, self.y), reach.low, reach.high, strict=True)
        )
        return [(int(a), int(b)) for a in i for b in j]


def covering(reaches: list[Reach], sensor: Sensor, spacing: float) -> Grid:
    """Return the grid that covers what all tools did.

    Args:
        reaches: What each tool did.
        sensor: The sensor.
        spacing: Distance of places [mm].
    """
    low, high = np.min([r.low for r in reaches], axis=0), np.max([r.high for r in reaches], axis=0)
    end = max(r.deepest for r in reaches) + DEEPER
    states = max(int(np.ceil(np.sqrt(end / UNIT) - 1e-9)) + 1, FEWEST)
    depth = UNIT * np.arange(states + EDGE) ** 2
    sides = [(float(a), float(b)) for a, b in zip(low - MARGIN, high + MARGIN, strict=True)]
    x, y = (_axis(a, b, spacing) for a, b in sides)
    grids = [Grid(x, y, depth, False)]
    if all(r.tilt == (0.0, 0.0) and foldable(sensor, r.indenter, r.yaw) for r in reaches):
        x, y = (_axis(-max(abs(a), abs(b)), max(abs(a), abs(b)), spacing) for a, b in sides)
        grids.append(Grid(x, y, depth, True))
    return min(grids, key=lambda g: sum(len(g.presses(r)) for r in reaches))


def _near(axis: np.ndarray, low: float, high: float, folded: bool) -> np.ndarray:
    """Return the inner nodes no farther than a node and the margin from a stretch, on one side if folded."""
    inner, room = np.arange(EDGE, len(axis) - EDGE), MARGIN + axis[1] - axis[0]
    if not folded:
        return inner[(axis[inner] >= low - room) & (axis[inner] <= high + room)]
    # A stretch over the middle begins at 0; one on the far side lies as far out as its mirror image.
    near = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    far = max(abs(low), abs(high))
    return inner[(axis[inner] >= max(near - room, -1e-9)) & (axis[inner] <= far + room)]


def _axis(low: float, high: float, spacing: float) -> np.ndarray:
    first, last = int(np.floor(low / spacing + 1e-9)), int(np.ceil(high / spacing - 1e-9))
    return spacing * np.arange(first - EDGE, last + 1 + EDGE)


def request(reach: Reach, x: float, y: float, depths: np.ndarray, sensor: Sensor) -> PressRequest | None:
    """Return the press of one place, as deep as it is possible there; None if it is not at all."""
    for count in range(len(depths), 1, -1):
        wanted = PressRequest(
            reach.indenter, round(float(x), 6), round(float(y), 6), reach.yaw,
            tuple(round(float(d), 6) for d in depths[:count]), *reach.tilt,
        )  # fmt: skip
        try:
            check_press(wanted, sensor)
        except SolveError:
            continue
        return wanted
    return None
