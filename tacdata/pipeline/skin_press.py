"""One press of a sensor's skin, solved by finite elements."""

from collections.abc import Sequence
from functools import cached_property

from threadpoolctl import threadpool_limits

from tacdata.indenters import Indenter, from_document
from tacdata.label_farm.presses.ladder import Ladder, goes_up_otherwise
from tacdata.labels import PathSolution
from tacdata.paths import StrPath
from tacdata.plans import Press
from tacdata.sensor import Sensor, default_sensor, read_sensor
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest


class SolvableSkin:
    """The skin of a sensor as a finite-element model; meshed at the first press, which takes seconds."""

    def __init__(
        self, sensor: Sensor | StrPath | None = None, device: str = "cpu", settings: ModelSettings | None = None
    ) -> None:
        """Name the skin.

        Args:
            sensor: The sensor or its file; None takes the shipped TacPrint.
            device: "cpu", or a GPU such as "cuda:0".
            settings: Discretization and solver.
        """
        design = default_sensor() if sensor is None else sensor
        self.sensor = design if isinstance(design, Sensor) else read_sensor(design)
        self.device, self.settings = device, settings

    @cached_property
    def model(self) -> SkinModel:
        """The meshed and factorized model.

        Raises:
            SolveError: If the geometry cannot be meshed or nothing holds the skin.
        """
        return SkinModel(self.sensor, self.settings, self.device)

    # A press has too little work for several threads: with two it takes a third longer.
    @threadpool_limits.wrap(limits=1)
    def solve(self, press: Press, depths: Sequence[float] | None = None) -> PathSolution:
        """Solve a press: maps, forces and their errors along the way down and up.

        Args:
            press: The press.
            depths: Depths of the states [mm], from 0 down and back to 0; None takes those of a label.

        Raises:
            SolveError: If the press is impossible or an equilibrium is not found.

        Example:
            >>> import tacdata as td
            >>> press = td.Press(td.indenter("sphere", radius=4.0), depth=0.4)
            >>> solution = td.Skin().solve(press, depths=(0.2, 0.4))  # doctest: +SKIP
            >>> solution.surface.shape  # doctest: +SKIP
            (2, 35, 26)
        """
        other_way_up = goes_up_otherwise(self.sensor.contact)
        states = tuple(depths) if depths is not None else Ladder().depths(press.depth, other_way_up)
        return self.model.solve(
            PressRequest(press.indenter, press.x, press.y, press.yaw, states, press.tilt_x, press.tilt_y)
        )

    def __repr__(self) -> str:
        """Return sensor and device."""
        return f"Skin of {self.sensor.name} on {self.device}"


def indenter(shape: str, **sizes: float) -> Indenter:
    """Return an indenter by its shape and sizes (lengths in mm, angles in degrees).

    Raises:
        UsageError: If no such shape is known.
        FormatError: If a size is missing, unknown or not positive.

    Example:
        >>> import tacdata as td
        >>> td.indenter("flat_punch", radius=1.5, edge_radius=0.3).extent
        1.5
    """
    return from_document({"shape": shape, **sizes})
