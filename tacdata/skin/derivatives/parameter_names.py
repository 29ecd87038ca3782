"""The parameters that a press can be differentiated by, by their names; without the solver's libraries."""

from __future__ import annotations

from dataclasses import fields

from tacdata.errors import UsageError
from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.materials import load_law

UNITS = {
    "x": "mm",
    "y": "mm",
    "z": "mm",
    "yaw": "deg",
    "tilt_x": "deg",
    "tilt_y": "deg",
    "thickness": "mm",
    "youngs_modulus": "MPa",
    "poisson_ratio": "1",
    "friction": "1",
    "bonding": "mm/MPa",
}
"""Units of the parameters that every press has.

- x, y, z: place of the indenter in the sensor's frame. z is up: a lower z is a deeper press.
- yaw, tilt_x, tilt_y: rotation about the indenter's own axis, then about the sensor's x and y, at its origin.
- thickness: of the slab. The depth still counts from the outer face, so that the indenter rises with it. For an
  indenter that stays in place, subtract the derivative by z.
- bonding: compliance of the support of held faces (`tacdata.skin.derivatives.bonding`), 0 in the model."""

_INDENTER = "indenter/"


def known(sensor: Sensor, indenter: Indenter) -> dict[str, str]:
    """Return the parameters of a press with their units: `UNITS`, ``indenter/NAME`` and ``material/NAME``.

    A law's parameter that is a list has one name for each entry, ``material/NAME/0`` and so on.
    """
    law = load_law(sensor.material.law).configured(sensor.material.parameters)
    names = dict(UNITS)
    names |= {f"indenter/{field.name}": "mm or deg" for field in fields(indenter)}
    for field in fields(law):
        value = getattr(law, field.name)
        entries = [f"/{k}" for k in range(len(value))] if isinstance(value, tuple) else [""]
        names |= {f"material/{field.name}{entry}": "1" for entry in entries}
    return names


def check(sensor: Sensor, indenter: Indenter, parameters: list[str]) -> None:
    """Refuse parameters that a press does not have.

    Raises:
        UsageError: Saying which.
    """
    allowed = known(sensor, indenter)
    if unknown := [name for name in parameters if name not in allowed]:
        raise UsageError(
            f"derivatives by {', '.join(unknown)}",
            ", ".join(allowed),
            "choose among these; the slash is part of the name",
        )
    if "friction" in parameters and not sensor.contact.friction:
        raise UsageError(
            "derivatives by friction of a sensor without friction",
            "a positive contact/friction",
            "set contact/friction in the sensor file, or leave the parameter out",
        )


def check_spreads(sensor: Sensor, indenter: Indenter) -> None:
    """Refuse spreads of parameters that no press on this skin has; sizes of indenters are ignored.

    Raises:
        UsageError: Naming them.
    """
    has = known(sensor, indenter)
    unknown = [name for name in sensor.uncertainty if name not in has and not name.startswith(_INDENTER)]
    if unknown:
        raise UsageError(
            f"sensor {sensor.name}: uncertainty of {', '.join(unknown)}",
            ", ".join(name for name in has if not name.startswith(_INDENTER)) + ", indenter/NAME",
            "correct the names under uncertainty in the sensor file",
        )
