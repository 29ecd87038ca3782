"""A job: one press path of one sensor and model version, named by the hash of all that decides its result."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.label_farm.presses.tolerance import Tolerance


@dataclass(frozen=True)
class Job:
    """One path to solve. Presses with the same configuration share it, whatever recording they come from."""

    sensor: str
    """Content hash of the sensor."""
    model: str
    """Content hash of the skin model: sensor, law, mesh, settings and the sources that decide a result."""
    indenter: dict[str, Any]
    """The indenter as plain data: shape and parameters [mm, deg]."""
    x: float
    """Location of the indenter's tip [mm]: its lowest point, if it is upright."""
    y: float
    """Location of the indenter's tip [mm]."""
    yaw: float
    """Rotation of the indenter about its own axis [deg]."""
    depths: tuple[float, ...]
    """Depths of the states [mm]: from 0 rising to the deepest, then falling to 0."""
    tolerance: Tolerance | None = None
    """Where states are to be added; None for these depths alone."""
    tilt_x: float = 0.0
    """How far its axis leans about x [deg], after the yaw and the tilt about y."""
    tilt_y: float = 0.0
    """How far its axis leans about y [deg], after the yaw."""

    @property
    def document(self) -> dict[str, Any]:
        """The job as plain data (`schemas/label_job.schema.json`)."""
        return {"version": schemas.version("label_job"), **self._content}

    @property
    def _content(self) -> dict[str, Any]:
        return {
            "sensor": self.sensor,
            "model": self.model,
            "indenter": self.indenter,
            "x": self.x,
            "y": self.y,
            "yaw": self.yaw,
            # Only if there are any: keys of upright presses stay those of releases without tilts.
            **{name: tilt for name in ("tilt_x", "tilt_y") if (tilt := getattr(self, name))},
            "depths": list(self.depths),
            **({"tolerance": asdict(self.tolerance)} if self.tolerance else {}),
        }

    @cached_property
    def key(self) -> str:
        """Hash of everything that decides the result (hex, 64 characters), not the format's version."""
        return provenance.content_hash(self._content)

    @classmethod
    def of_text(cls, text: str) -> Job:
        """Rebuild a job from JSON that this code wrote itself, so that it is not checked again."""
        values: dict[str, Any] = json.loads(text)
        del values["version"]
        tolerance = Tolerance(**values["tolerance"]) if "tolerance" in values else None
        values |= {"depths": tuple(values["depths"]), "tolerance": tolerance}
        return cls(**values)

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str = "job") -> Job:
        """Rebuild a job from `document`.

        Raises:
            FormatError: If it breaks the schema.
        """
        documents.check(document, "label_job", origin)
        values: dict[str, Any] = {k: v for k, v in document.items() if k != "version"}
        tolerance = Tolerance(**document["tolerance"]) if "tolerance" in document else None
        values |= {"depths": tuple(document["depths"]), "tolerance": tolerance}
        return cls(**values)

    @property
    def deepest(self) -> float:
        """Greatest depth of the path [mm]."""
        return max(self.depths)
