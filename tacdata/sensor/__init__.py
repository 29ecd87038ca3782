"""The sensor description: one versioned file states everything about a taxel skin."""

from tacdata.sensor.adhesion import Adhesion
from tacdata.sensor.material import Material
from tacdata.sensor.sensor import ContactProperties, DepthMap, Sensor, Skin, Taxels, default_sensor, read_sensor
from tacdata.sensor.transduction import Transduction

__all__ = [
    "Adhesion",
    "ContactProperties",
    "DepthMap",
    "Material",
    "Sensor",
    "Skin",
    "Taxels",
    "Transduction",
    "default_sensor",
    "read_sensor",
]
