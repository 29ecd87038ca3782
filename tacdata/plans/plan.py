"""A press plan and its presses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any

from tacdata import documents
from tacdata.display import Displayed
from tacdata.errors import FormatError
from tacdata.indenters import Indenter, from_document
from tacdata.paths import StrPath
from tacdata.plans.beside_skin import check_touch
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Press:
    """One press: contact configuration and motion, in the sensor frame.

    Example:
        >>> import tacdata as td
        >>> press = td.Press(td.indenter("sphere", radius=4.0), depth=0.8, x=2.0)
        >>> print(press)
        sphere (radius 4) at x 2, y 0 mm, 0.8 mm deep
    """

    indenter: Indenter
    """The indenter."""
    depth: float
    """Depth of the lowest point below the undeformed outer face at (x, y) [mm]; negative passes above without contact.
    """
    x: float = 0.0
    """Location of the indenter's tip [mm]: its lowest point, if it is upright."""
    y: float = 0.0
    """Location of the indenter's tip [mm]."""
    yaw: float = 0.0
    """Rotation of the indenter about its own axis [deg]."""
    speed: float = 1.0
    """Loading and unloading speed [mm/s]."""
    hold: float = 0.5
    """Time at full depth [s]."""
    _: KW_ONLY
    index: int = 0
    """Number in the plan, from 0; also the episode's number."""
    indenter_name: str = ""
    """The plan's name for that indenter."""
    repeat: int = 0
    """Which repetition of the same configuration this is, from 0."""
    rest: float | None = None
    """Time without contact before the press [s]; None: by the plan's motion settings."""
    recovery: float = 0.0
    """Recorded time without contact after the release [s]."""
    approach_from: str = ""
    """Side from which the guide comes over the site: "+x", "-x", "+y" or "-y"; empty for any."""
    overshoot: float = 0.0
    """How much deeper than ``depth`` the guide goes before it comes back up to it [mm]."""
    strokes: int = 0
    """How often the guide comes up by ``stroke`` and goes back to ``depth``, before it holds [1]."""
    stroke: float = 0.0
    """By how much it comes up each time [mm]."""
    purpose: str = ""
    """Purpose of the press, as text; presses with the same purpose belong together."""
    tilt_x: float = 0.0
    """Tilt of the indenter's axis about x [deg], applied after the yaw and the tilt about y."""
    tilt_y: float = 0.0
    """Tilt of the indenter's axis about y [deg], applied after the yaw."""

    def __str__(self) -> str:
        """Return shape, place and depth as text."""
        sizes = [
            f"{name.replace('_', ' ')} {value:g}" for name, value in self.indenter.document.items() if _number(value)
        ]
        turn = f", turned by {self.turned}" if any(self.angles.values()) else ""
        shape = f"{self.indenter.shape} ({', '.join(sizes)})" if sizes else self.indenter.shape
        return f"{shape} at x {self.x:g}, y {self.y:g} mm, {self.depth:g} mm deep{turn}"

    @property
    def angles(self) -> dict[str, float]:
        """Angles of the indenter [deg]: the yaw, and tilts that are not 0, as entries of a plan."""
        tilts = {"tilt_x": self.tilt_x, "tilt_y": self.tilt_y}
        return {"yaw": self.yaw, **{name: tilt for name, tilt in tilts.items() if tilt}}

    @property
    def turned(self) -> str:
        """The angles as text, for example ``15 deg, leaning 5 deg about x``."""
        leans = [f"{t:g} deg about {axis}" for axis, t in (("x", self.tilt_x), ("y", self.tilt_y)) if t]
        return f"{self.yaw:g} deg" + (f", leaning {' and '.join(leans)}" if leans else "")

    @property
    def mounting(self) -> tuple[str, float, float, float]:
        """The indenter's name and angles [deg]; presses that share it need no remounting between them."""
        return self.indenter_name, self.yaw, self.tilt_x, self.tilt_y

    @property
    def deepest(self) -> float:
        """Largest commanded depth [mm]."""
        return self.depth + self.overshoot

    @property
    def document(self) -> dict[str, Any]:
        """The press as plain data (JSON types)."""
        left_out = {"indenter", *({"tilt_x", "tilt_y"} - self.angles.keys())}
        # Presses without strokes keep the document, and the hash, that they had before strokes existed.
        left_out |= set() if self.strokes else {"strokes", "stroke"}
        values = {k: v for k, v in vars(self).items() if k not in left_out}
        return {**values, "indenter": self.indenter.document}

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str = "press") -> Press:
        """Read a press from its `document`."""
        values: dict[str, Any] = {**document, "indenter": from_document(document["indenter"], origin)}
        return cls(**values)


@dataclass(frozen=True)
class MotionSettings:
    """Motion of the plan's presses, unless a press states otherwise."""

    clearance: float
    """Height above the skin for travel between sites [mm]."""
    travel_speed: float
    """Speed between sites [mm/s]."""
    approach_speed: float
    """Speed from the clearance down to the standoff [mm/s]."""
    press_speed: float
    """Loading and unloading speed [mm/s]."""
    hold: float
    """Time at full depth [s]."""
    rest: float
    """Time without contact before each press [s]."""
    standoff: float = 0.3
    """Height at which the approach speed changes to the press speed [mm]."""
    run_up: float = 1.0
    """Sideways distance over which a press with ``approach_from`` comes to its site [mm]."""


@dataclass(frozen=True, repr=False)
class Plan(Displayed):
    """A named list of presses, with their indenters and motion settings.

    Example:
        >>> import tacdata as td
        >>> session = td.read_session("session")
        >>> len(session.plan.presses)
        2
        >>> session.plan.check_against(session.sensor)  # raises FormatError if a press misses the skin
    """

    name: str
    motion: MotionSettings
    presses: tuple[Press, ...]
    purpose: str = ""
    on_bad_readings: str = "stop"
    """Reaction when the board freezes, saturates or becomes slow: "stop", "pause" or "go on"."""
    document: dict[str, Any] | None = None
    """The file's document, unchanged."""

    def description(self) -> Iterator[str]:
        """Yield the plan: presses, shapes, depths, sites."""
        sites = {(press.x, press.y) for press in self.presses}
        yield f"Plan {self.name}: {len(self.presses)} presses at {len(sites)} sites"
        if self.presses:
            depths = [press.depth for press in self.presses]
            yield f"{min(depths):g} to {max(depths):g} mm deep"
            yield f"indenters {', '.join(dict.fromkeys(press.indenter_name for press in self.presses))}"
        if self.purpose:
            yield self.purpose

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str, folder: Path | None = None) -> Plan:
        """Build a plan from a parsed file; names of surface files in it are relative to ``folder``.

        Raises:
            FormatError: If the document breaks the schema or a press names an unknown indenter.
        """
        documents.check(document, "plan", origin)
        indenters = {
            name: from_document(values, f"{origin}: indenters/{name}", folder)
            for name, values in document["indenters"].items()
        }
        # From here on, a shape from a file is identified by its content.
        document = {**document, "indenters": {name: indenter.document for name, indenter in indenters.items()}}
        motion = MotionSettings(**document["motion"])
        presses = []
        for index, entry in enumerate(document["presses"]):
            name = entry["indenter"]
            if name not in indenters:
                raise FormatError(
                    f"{origin}: presses/{index}/indenter: {name!r} is not among the plan's indenters",
                    ", ".join(indenters),
                    "name one of them or add it under indenters",
                )
            # A press above the skin must still be below the height of travel, or it is none.
            if -entry["depth"] >= motion.clearance:
                raise FormatError(
                    f"{origin}: presses/{index}: depth {entry['depth']:g} mm flies no lower than the clearance, "
                    f"{motion.clearance:g} mm",
                    f"above -{motion.clearance:g} mm",
                    "fly lower, or enlarge motion/clearance",
                )
            presses.append(_press(index, entry, indenters[name], motion))
        purpose, reaction = document.get("purpose", ""), document.get("on_bad_readings", "stop")
        return cls(document["name"], motion, tuple(presses), purpose, reaction, document)

    def check_against(self, sensor: Sensor) -> None:
        """Refuse presses that would miss the skin or pierce it.

        Raises:
            FormatError: Naming the first such press.
        """
        for press in self.presses:
            where = f"plan {self.name}: presses/{press.index}"
            if press.deepest >= sensor.skin.thickness:
                raise FormatError(
                    f"{where}: depth {press.deepest:g} mm, the skin is {sensor.skin.thickness:g} mm thick",
                    f"less than {sensor.skin.thickness:g} mm",
                    "reduce the depth or use another sensor file",
                )
            for axis, value, size in (("x", press.x, sensor.skin.size_x), ("y", press.y, sensor.skin.size_y)):
                if abs(value) > size / 2:
                    raise FormatError(
                        f"{where}: {axis} = {value:g} mm is off the skin",
                        f"-{size / 2:g} to {size / 2:g} mm",
                        f"move the press or enlarge skin/size_{axis}",
                    )
            # `check_touch` knows upright shapes alone.
            if press.deepest > 0 and press.tilt_x == press.tilt_y == 0:
                size = sensor.skin.size_x, sensor.skin.size_y
                check_touch(press.indenter, size, (press.x, press.y), press.yaw, press.deepest, where)


def _number(value: object) -> bool:
    return isinstance(value, int | float)


def _press(index: int, entry: dict[str, Any], indenter: Indenter, motion: MotionSettings) -> Press:
    # The entries of a press bear the names of its fields (`schemas/plan.schema.json`).
    values: dict[str, Any] = {"speed": motion.press_speed, "hold": motion.hold, **entry, "indenter": indenter}
    return Press(index=index, indenter_name=entry["indenter"], **values)


def read_plan(path: StrPath) -> Plan:
    """Read a plan file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    path = Path(path)
    return Plan.from_document(documents.read(path, "plan"), str(path), path.parent)
