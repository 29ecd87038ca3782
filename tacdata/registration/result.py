"""The result of a registration, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from tacdata import provenance, schemas
from tacdata.registration.cross_scan import Cross
from tacdata.registration.settings import RegistrationSettings
from tacdata.registration.solution import Plane, RigidMotion
from tacdata.registration.touch_off import Touch
from tacdata.rig import Registration, Rig
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Found:
    """A registration with all data behind it."""

    plane: Plane
    motion: RigidMotion
    touches: tuple[Touch, ...]
    crosses: tuple[Cross, ...]
    noise: np.ndarray
    """Standard deviation of each channel without contact [counts], shape (channels,)."""
    settings: RegistrationSettings

    @property
    def registration(self) -> Registration:
        """Pose of the sensor."""
        x, y = self.motion.shift
        return Registration((x, y, self.plane.at(x, y)), self.motion.yaw, self.tilt)

    @property
    def tilt(self) -> tuple[float, float]:
        """Rise of the skin along the sensor's x and y [mm/mm]."""
        c, s = np.cos(np.radians(self.motion.yaw)), np.sin(np.radians(self.motion.yaw))
        a, b = self.plane.slope
        return float(c * a + s * b), float(-s * a + c * b)

    @property
    def uncertainty(self) -> dict[str, Any]:
        """Standard uncertainties: origin [mm], yaw [deg], tilt [mm/mm]."""
        x, y = self.motion.shift
        slope = float(np.sqrt(np.diag(self.plane.covariance)[1:]).max())
        # A tilt error s makes one side of a line deeper: d^p exp(-x^2 / 2 w^2) leans by w^2 p s / d, where
        # the answer's width w is at most about the length of the lines.
        width = max(float(np.ptp(place)) / 4 for cross in self.crosses for place, _ in cross.lines)
        lean = width**2 * float(np.mean([t.onset.power for t in self.touches])) * slope / self.settings.depth
        height = float(np.hypot(self.plane.uncertainty_at(x, y), np.mean([t.onset.model for t in self.touches])))
        return {
            "origin": [*(float(np.hypot(u, lean)) for u in self.motion.shift_uncertainty), height],
            "yaw": self.motion.yaw_uncertainty,
            "tilt": [slope] * 2,
        }

    @property
    def text(self) -> str:
        """The result as text."""
        place, sigma = self.registration, self.uncertainty
        x, y, z = (f"{value:.3f} +- {u:.3f}" for value, u in zip(place.origin, sigma["origin"], strict=True))
        return (
            f"origin  x {x}, y {y}, z {z} mm\n"
            f"yaw     {place.yaw:.3f} +- {sigma['yaw']:.3f} deg\n"
            f"tilt    {1000 * place.tilt[0]:.2f}, {1000 * place.tilt[1]:.2f} +- {1000 * sigma['tilt'][0]:.2f} um/mm\n"
            f"residual of the touches {1000 * np.abs(self.plane.residual).max():.0f} um, of the taxels "
            f"{1000 * self.motion.residual.max():.0f} um"
        )


def document_of(
    measurement: Found, rig: Rig, sensor: Sensor, indenter: dict[str, Any], controller: dict[str, str]
) -> dict[str, Any]:
    """Return the registration's document (`schemas/registration.schema.json`)."""
    place = measurement.registration
    return {
        "version": schemas.version("registration"),
        "method": "touch-off and cross scan",
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "code_version": provenance.code_version(),
        "rig": rig.name,
        "guess": dict(rig.document["registration"]),
        "sensor": sensor.name,
        "sensor_hash": sensor.content_hash,
        "indenter": indenter,
        # The settings by which a later session judges whether machine zero is the same.
        "controller": {key: controller[key] for key in ("banner", "$20", "$22") if key in controller},
        "settings": {k: list(v) if isinstance(v, tuple) else v for k, v in vars(measurement.settings).items()},
        "origin": [round(value, 5) for value in place.origin],
        "yaw": round(place.yaw, 5),
        "tilt": [round(value, 7) for value in place.tilt],
        "uncertainty": measurement.uncertainty,
        "residuals": {
            "touches": _numbers(measurement.plane.residual, 5),
            "taxels": _numbers(measurement.motion.residual, 5),
            "scale": round(measurement.motion.scale, 5),
        },
        "noise": _numbers(measurement.noise, 3),
        "touches": [
            {
                "site": t.site,
                "x": t.x,
                "y": t.y,
                "z": t.onset.height,
                "uncertainty": t.onset.uncertainty,
                "model": t.onset.model,
                "power": t.onset.power,
                "height": _numbers(t.height, 4),
                "answer": _numbers(t.answer, 3),
            }
            for t in measurement.touches
        ],
        "crosses": [
            {
                "taxel": c.taxel,
                "x": c.x,
                "y": c.y,
                "uncertainty": list(c.uncertainty),
                "lines": [{"place": _numbers(p, 4), "answer": _numbers(a, 3)} for p, a in c.lines],
            }
            for c in measurement.crosses
        ],
    }


def _numbers(values: np.ndarray, digits: int) -> list[float]:
    return [round(value, digits) for value in np.asarray(values, dtype=float).tolist()]
