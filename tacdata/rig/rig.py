"""A rig file as immutable data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.clock import Clock
from tacdata.errors import FormatError


@dataclass(frozen=True)
class Registration:
    """How the sensor lies in the guide's frame: machine = origin + R_z(yaw) (x, y, z - thickness)."""

    origin: tuple[float, float, float]
    """Machine position [mm] at which the tip touches the undeformed outer face at the array's centre."""
    yaw: float
    """Rotation of the sensor's x axis against the machine's [deg]."""

    def to_machine(self, x: float, y: float, depth: float) -> tuple[float, float, float]:
        """Return the machine position [mm] of a tip at (x, y) [mm, sensor frame], ``depth`` [mm] below the skin."""
        c, s = np.cos(np.radians(self.yaw)), np.sin(np.radians(self.yaw))
        return (
            float(self.origin[0] + c * x - s * y),
            float(self.origin[1] + s * x + c * y),
            float(self.origin[2] - depth),
        )

    def to_sensor(self, position: np.ndarray) -> np.ndarray:
        """Return x, y, depth [mm], shape (n, 3), of machine positions [mm], shape (n, 3)."""
        c, s = np.cos(np.radians(self.yaw)), np.sin(np.radians(self.yaw))
        dx, dy = position[:, 0] - self.origin[0], position[:, 1] - self.origin[1]
        return np.stack([c * dx + s * dy, -s * dx + c * dy, self.origin[2] - position[:, 2]], axis=-1)


@dataclass(frozen=True)
class Envelope:
    """The box of machine positions that may be commanded."""

    min: tuple[float, float, float]
    """Lower corner [mm]."""
    max: tuple[float, float, float]
    """Upper corner [mm]."""

    def contains(self, position: tuple[float, float, float]) -> bool:
        """Say whether a machine position [mm] lies inside."""
        return all(a <= p <= b for a, p, b in zip(self.min, position, self.max, strict=True))


@dataclass(frozen=True)
class Rig:
    """A rig as its file describes it."""

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


def from_document(document: dict[str, Any], origin: str) -> Rig:
    """Build a rig from a parsed file; ``origin`` names it in errors.

    Raises:
        FormatError: If the document breaks the schema or the envelope is empty.
    """
    documents.check(document, "rig", origin)
    envelope = Envelope(tuple(document["envelope"]["min"]), tuple(document["envelope"]["max"]))
    if any(a >= b for a, b in zip(envelope.min, envelope.max, strict=True)):
        raise FormatError(
            f"{origin}: envelope min {envelope.min} mm, max {envelope.max} mm",
            "min below max on every axis",
            "correct the envelope",
        )
    clock = Clock(**document["clock"]) if "clock" in document else Clock.start()
    registration = document["registration"]
    return Rig(
        document["name"], document["cnc"], document["board"], document.get("cameras", {}),
        Registration(tuple(registration["origin"]), registration["yaw"]), envelope, clock, document,
    )


def read_rig(path: Path) -> Rig:
    """Read a rig file.

    Raises:
        UsageError: If it does not exist.
        FormatError: If it is damaged or contradicts itself.
    """
    return from_document(documents.read(path, "rig"), str(path))
