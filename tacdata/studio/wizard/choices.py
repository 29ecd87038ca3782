"""Everything that a person may choose on the page."""

from dataclasses import dataclass, field

from tacdata.importing.mapping import TrialRule

ROLES = {
    "time": "time",
    "channels": "channel",
    "depth": "depth",
    "z": "height (z)",
    "x": "place x",
    "y": "place y",
    "force": "force",
    "temperature": "temperature",
    "displacement": "second gauge",
    "counter": "counter of rows",
    "trial": "number of the trial",
    "specimen": "specimen",
    "": "not used",
}
"""Role -> its name on the page."""
UNITS = {
    "time": ("s", "ms", "us", "ns", "min", "h", "d", "datenum", "excel", "datetime"),
    **dict.fromkeys(("depth", "z", "x", "y", "displacement"), ("mm", "um", "m", "cm", "in")),
    "force": ("N", "mN", "g", "kg", "lbf"),
    "temperature": ("degC", "K", "degF"),
    "channels": ("pF", "V", "mV", "ohm", "kPa", "counts"),
}
"""Role -> units that are offered; any other may be typed, except of a time."""
AXES = ("x", "y", "z", "depth")
FURTHER = ("displacement", "force", "temperature")
"""Roles of further measured quantities."""


@dataclass(frozen=True)
class ColumnRole:
    """The role of one column."""

    file: str
    """Name under ``files``."""
    column: str
    role: str = ""
    """One of `ROLES`."""
    unit: str = ""
    """Empty: by the file."""
    scale: float = 1.0
    """-1 turns the sign."""


@dataclass(frozen=True)
class Choices:
    """The choices of a person, one value each."""

    assignments: tuple[ColumnRole, ...] = ()
    rates: dict[str, float] = field(default_factory=dict)
    """File without a time -> its rows a second [Hz]."""
    formats: dict[str, str] = field(default_factory=dict)
    """File -> layout of its dates."""
    trials: TrialRule = field(default_factory=TrialRule)
    """The end of a trial, unless a column numbers them."""
    contact: float | None = None
    """Height at which the skin is touched [mm]; None: the highest of each trial."""
    zero: str = ""
    """Value of each trial that counts as 0: first, lowest, highest; empty: 0 itself."""
    offset: float = 0.0
    """Added to the depth or the height [mm]."""
    trusted: bool = False
    """Whether dropouts, jumps and gaps of the position count as measured."""
    specimen: str = ""
    """A {part} of the path that names the specimen."""
    radius: float | None = None
    """Radius of a sphere that pressed [mm]; None: as the mapping has it."""
    name: str = ""
    source: str = ""
    """Where the data come from."""

    def of_role(self, *roles: str) -> list[ColumnRole]:
        """Return the assignments of some roles, in the order of the columns."""
        return [each for each in self.assignments if each.role in roles]
