"""The presses of a table: positions and depths common to all sessions, so that presses are reused.

Positions are multiples of a spacing from the array's centre. Depths are `UNIT` times squares: equally spaced in their
square root, as loads at first contact require.
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
"""Nodes beyond the solved ones, at every end: splines are mirrored at the ends of places, where that does no harm."""
MARGIN = 0.2
"""Margin around the pressed positions [mm]: effects move the tip."""
DEEPER = 0.1
"""Margin below the deepest press [mm]."""
UNIT = 0.0075
"""Depth of the first node [mm]."""
FEWEST = 9
"""Minimum number of depths, the undeformed state included."""


@dataclass(frozen=True)
class Reach:
    """Positions and depths of one tool."""

    indenter: Indenter
    yaw: float
    """Yaw of its mounting [deg]."""
    low: tuple[float, float]
    """Least x and y [mm]."""
    high: tuple[float, float]
    """Largest x and y [mm]."""
    deepest: float
    """Largest depth [mm]."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Tilt of its axis about x and y [deg]."""


@dataclass(frozen=True)
class Grid:
    """Nodes of one table."""

    x: np.ndarray
    """[mm], shape (a,), equally spaced, `EDGE` of them at each end beyond the solved ones."""
    y: np.ndarray
    """The same along y [mm], shape (b,)."""
    depth: np.ndarray
    """[mm], shape (d,), from 0, equally spaced in their root, `EDGE` of them beyond the solved ones."""
    folded: bool
    """Whether the sensor is symmetric, so that a quarter of the positions is solved."""

    @property
    def states(self) -> int:
        """Number of depths solved."""
        return len(self.depth) - EDGE

    def presses(self, reach: Reach) -> list[tuple[int, int]]:
        """Return the nodes to solve for a tool, by number along x and y: those around its presses."""
        i, j = (
            _near(axis, low, high, self.folded)
            for axis, low, high in zip((self.x, self.y), reach.low, reach.high, strict=True)
        )
        return [(int(a), int(b)) for a in i for b in j]


def covering(reaches: list[Reach], sensor: Sensor, spacing: float) -> Grid:
    """Return the grid that covers the positions and depths of all tools.

    Args:
        reaches: Positions and depths of each tool.
        sensor: The sensor.
        spacing: Spacing of the positions [mm].
    """
    low, high = np.min([r.low for r in reaches], axis=0), np.max([r.high for r in reaches], axis=0)
    end = max(r.deepest for r in reaches) + DEEPER
    # Depth k is the unit times k squared, so the number of states is a root.
    states = max(int(np.ceil(np.sqrt(end / UNIT) - 1e-9)) + 1, FEWEST)
    # The same depths whatever the session: a deeper one adds nodes and reuses the others.
    depth = UNIT * np.arange(states + EDGE) ** 2
    sides = [(float(a), float(b)) for a, b in zip(low - MARGIN, high + MARGIN, strict=True)]
    x, y = (_axis(a, b, spacing) for a, b in sides)
    # A folded grid is symmetric about the middle and may need more presses than its symmetry saves.
    grids = [Grid(x, y, depth, False)]
    if all(r.tilt == (0.0, 0.0) and foldable(sensor, r.indenter, r.yaw) for r in reaches):
        x, y = (_axis(-max(abs(a), abs(b)), max(abs(a), abs(b)), spacing) for a, b in sides)
        grids.append(Grid(x, y, depth, True))
    # The one with fewer presses.
    return min(grids, key=lambda g: sum(len(g.presses(r)) for r in reaches))


def _near(axis: np.ndarray, low: float, high: float, folded: bool) -> np.ndarray:
    """Return the inner nodes within a node and the margin of a stretch, on one side if folded."""
    inner, room = np.arange(EDGE, len(axis) - EDGE), MARGIN + axis[1] - axis[0]
    if not folded:
        return inner[(axis[inner] >= low - room) & (axis[inner] <= high + room)]
    # A stretch over the middle begins at 0; one on the far side is as far out as its mirror image.
    near = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    far = max(abs(low), abs(high))
    return inner[(axis[inner] >= max(near - room, -1e-9)) & (axis[inner] <= far + room)]


def _axis(low: float, high: float, spacing: float) -> np.ndarray:
    first, last = int(np.floor(low / spacing + 1e-9)), int(np.ceil(high / spacing - 1e-9))
    return spacing * np.arange(first - EDGE, last + 1 + EDGE)


def request(reach: Reach, x: float, y: float, depths: np.ndarray, sensor: Sensor) -> PressRequest | None:
    """Return the press at one position, as deep as possible there; None if none is possible."""
    for count in range(len(depths), 1, -1):
        # Rounded, as stored and shipped presses are found by these very numbers.
        place = (round(float(v), 6) for v in (x, y))
        states = tuple(round(float(d), 6) for d in depths[:count])
        press = PressRequest(reach.indenter, *place, reach.yaw, states, *reach.tilt)
        try:
            check_press(press, sensor)
        except SolveError:
            continue
        return press
    return None
