"""A rig file as immutable data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, registry
from tacdata.clock import Clock
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.paths import StrPath


@dataclass(frozen=True)
class Registration:
    """Pose of the sensor in the guide's frame: machine = origin + R_z(yaw) (x, y, tilt . (x, y) - depth).

    Depth is counted along the guide's z from the tilted outer face. Terms of second order in the tilt are neglected
    (0.15 % of a length at 3 deg).

    Example:
        >>> import numpy as np
        >>> from tacdata.rig import Registration
        >>> registration = Registration(origin=(40.0, 25.0, 12.0), yaw=90.0)
        >>> registration.to_sensor(np.array([[40.0, 26.0, 11.5]])).round(3)  # x, y, depth [mm]
        array([[1. , 0. , 0.5]])
    """

    origin: tuple[float, float, float]
    """Machine position [mm] at which the tip touches the undeformed outer face at the array's centre."""
    yaw: float
    """Rotation of the sensor's x axis against the machine's [deg]."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Rise of the outer face along the sensor's x and along its y [mm/mm]."""

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Registration:
        """Build it from the ``registration`` of a rig file (`schemas/rig.schema.json`)."""
        tilt = document.get("tilt", (0.0, 0.0))
        return cls(tuple(document["origin"]), document["yaw"], tuple(tilt))

    def with_tool(self, offset: tuple[float, float, float]) -> Registration:
        """Return the registration for an indenter whose lowest point is at ``offset`` from the registered one's [mm,
        machine axes].
        """
        x, y, z = (coordinate - shift for coordinate, shift in zip(self.origin, offset, strict=True))
        return replace(self, origin=(x, y, z))

    def to_machine(self, x: float, y: float, depth: float) -> tuple[float, float, float]:
        """Return the machine position [mm] of a tip at (x, y) [mm, sensor frame], ``depth`` [mm] below the skin."""
        c, s = np.cos(np.radians(self.yaw)), np.sin(np.radians(self.yaw))
        return (
            float(self.origin[0] + c * x - s * y),
            float(self.origin[1] + s * x + c * y),
            float(self.origin[2] + self.tilt[0] * x + self.tilt[1] * y - depth),
        )

    def to_sensor(self, position: np.ndarray) -> np.ndarray:
        """Return x, y, depth [mm], shape (n, 3), of machine positions [mm], shape (n, 3)."""
        c, s = np.cos(np.radians(self.yaw)), np.sin(np.radians(self.yaw))
        dx, dy = position[:, 0] - self.origin[0], position[:, 1] - self.origin[1]
        x, y = c * dx + s * dy, -s * dx + c * dy
        height = position[:, 2] - self.origin[2] - self.tilt[0] * x - self.tilt[1] * y
        return np.stack([x, y, -height], axis=-1)


@dataclass(frozen=True)
class Envelope:
    """The box of machine positions that may be commanded."""

    min: tuple[float, float, float]
    """Lower corner [mm]."""
    max: tuple[float, float, float]
    """Upper corner [mm]."""

    def contains(self, position: tuple[float, float, float]) -> bool:
        """Whether a machine position [mm] is inside."""
        return all(a <= p <= b for a, p, b in zip(self.min, position, self.max, strict=True))

    def top_of_rise(self, position: tuple[float, float, float], height: float) -> tuple[float, float, float]:
        """Return where a rise from ``position`` to machine ``height`` ends [mm].

        Raises:
            DeviceError: If that is outside: the guide is beyond the limits of the rig file.
        """
        x, y, z = position
        top = x, y, max(z, height)
        if not self.contains(top):
            raise DeviceError(
                f"the guide stands at ({x:.2f}, {y:.2f}, {z:.2f}) mm, outside the envelope",
                f"{self.min} to {self.max} mm",
                "jog it inside, or correct the rig file",
            )
        return top


@dataclass(frozen=True)
class Rig:
    """A rig: devices, registration, envelope and clock."""

    name: str
    cnc: dict[str, Any]
    """Driver and settings of the motion controller."""
    board: dict[str, Any]
    """Driver and settings of the taxel board."""
    cameras: dict[str, dict[str, Any]]
    """Name -> driver, settings, intrinsics and cube of each camera."""
    registration: Registration
    envelope: Envelope
    clock: Clock
    document: dict[str, Any]
    """The file's document, as attached to every recording."""
    fingers: dict[str, Any] | None = None
    """Cubes and fingertips of fingers (`schemas/fingers.schema.json`), if any."""

    def registration_for(self, indenter: str) -> Registration:
        """Return the registration for an indenter, named as in a plan."""
        return registration_for(self.document, indenter)

    def registered(self, document: dict[str, Any], sensor_hash: str, origin: str) -> Rig:
        """Return the rig with the registration that `tacdata register` measured (`schemas/registration.schema.json`).

        Args:
            document: The registration's document.
            sensor_hash: Content hash of the sensor that will be pressed.
            origin: Names the document in errors.

        Raises:
            FormatError: If the document breaks its schema.
            UsageError: If it belongs to another rig or sensor.
        """
        documents.check(document, "registration", origin)
        for what, stated, present in (
            ("rig", document["rig"], self.name),
            ("sensor", document["sensor_hash"], sensor_hash),
        ):
            if stated != present:
                raise UsageError(
                    f"{origin} was measured with another {what} ({document[what]})",
                    f"this {what}",
                    "run tacdata register again, or name the registration that belongs to it",
                )
        fields = {k: document[k] for k in ("origin", "yaw", "tilt", "method", "date", "uncertainty", "sensor_hash")}
        residuals = document["residuals"]
        fields["residual"] = max(map(abs, [*residuals["touches"], *residuals["taxels"]]))
        fields["document_hash"] = provenance.content_hash(document)
        return replace(
            self, registration=Registration.from_document(fields), document={**self.document, "registration": fields}
        )


def registration_for(document: dict[str, Any], indenter: str) -> Registration:
    """Return the registration of a rig file's document with the tool offset of an indenter, if it has one."""
    registration = Registration.from_document(document["registration"])
    tool = document.get("tools", {}).get(indenter)
    return registration.with_tool(tuple(tool["offset"])) if tool else registration


def from_document(document: dict[str, Any], origin: str) -> Rig:
    """Build a rig from a parsed file.

    ``origin`` names it in errors and is where the files that it names are searched.

    Raises:
        FormatError: If the document breaks the schema or the envelope is empty.
    """
    documents.check(document, "rig", origin)
    if isinstance(document.get("fingers"), str):
        # The recording carries the fingers themselves, whatever becomes of their file.
        document = {**document, "fingers": documents.read(Path(origin).parent / document["fingers"], "fingers")}
    elif "fingers" in document:
        documents.check(document["fingers"], "fingers", f"{origin}: fingers")
    if "state_directory" in document:
        document = {**document, "state_directory": str(Path(origin).parent.absolute() / document["state_directory"])}
    envelope = Envelope(tuple(document["envelope"]["min"]), tuple(document["envelope"]["max"]))
    if any(a >= b for a, b in zip(envelope.min, envelope.max, strict=True)):
        raise FormatError(
            f"{origin}: envelope min {envelope.min} mm, max {envelope.max} mm",
            "min below max on every axis",
            "correct the envelope",
        )
    clock = Clock.from_document(document["clock"]) if "clock" in document else Clock.start()
    return Rig(
        document["name"],
        document["cnc"],
        document["board"],
        document.get("cameras", {}),
        Registration.from_document(document["registration"]),
        envelope,
        clock,
        document,
        document.get("fingers"),
    )


def read_rig(path: StrPath) -> Rig:
    """Read a rig file; the plug-ins that it names are available from then on.

    Raises:
        UsageError: If it does not exist, or its folder of plug-ins.
        FormatError: If it is damaged or contradicts itself.
    """
    path = Path(path)
    document = documents.read(path, "rig")
    if "plugins" in document:
        registry.add_folder(path.parent / document["plugins"])
    return from_document(document, str(path))
