"""Sensors of the benchmark: the default one, whose presses ship, and others, whose presses a lab must solve."""

from tacdata.indenters import from_document
from tacdata.plans.specimens import specimens
from tacdata.sensor import Sensor, default_sensor

UNITS = {"default": {}, "thin": {"thickness": 2.2}, "thick": {"thickness": 4.4}, "stout": {"protrusion_radius": 0.9}}
"""Dimensions of the skin that differ from the default sensor [mm]."""


def sensor_of(unit):
    """Return the sensor of a unit."""
    if not UNITS[unit]:
        return default_sensor()
    document = default_sensor().document
    document["skin"] |= UNITS[unit]
    return Sensor.from_document({**document, "name": unit}, unit)


def tools():
    """Return the tools that the worlds press with, in their order."""
    return {name: from_document(document, name) for name, document in specimens(("sphere_4", "sphere_2")).items()}
