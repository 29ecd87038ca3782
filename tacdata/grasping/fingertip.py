"""The skin on a gripper's fingertip: the default sensor, held at the border of its underside.

The default sensor's sides are bonded, so nothing may press over its rim. An object in a gripper does press over the
rim. So here a border of 1 mm of the underside is bonded and the sides are free.
"""

from __future__ import annotations

from dataclasses import replace

from tacdata.sensor import Sensor, default_sensor

RIM = 1.0
"""Width of the bonded border of the underside [mm]."""


def fingertip_sensor() -> Sensor:
    """Return the sensor of this study: the default one with other bonding."""
    sensor = default_sensor()
    assumptions = {
        **sensor.assumptions,
        "contact/bonded": "objects press over the edge, so the sides are free and a border of the underside is held",
    }
    contact = replace(sensor.contact, bonded=("rim",), rim_width=RIM)
    return replace(sensor, name="tacprint_fingertip", contact=contact, assumptions=assumptions)
