"""The skin on a gripper's fingertip: the default sensor, held at the border of its underside.

The default sensor's side faces are taken as bonded, so that nothing may press over its rim. An object that a gripper
takes hold of does; here a border of 1 mm of the underside is held and the sides are free.
"""

from __future__ import annotations

from dataclasses import replace

from tacdata.sensor import Sensor, default_sensor

RIM = 1.0
"""Width of the underside's border that is held [mm]."""


def fingertip_sensor() -> Sensor:
    """Return the sensor of this study; all but its bonding is the default one's."""
    sensor = default_sensor()
    assumptions = {
        **sensor.assumptions,
        "contact/bonded": "objects press over the edge, so the sides are free and a border of the underside is held",
    }
    contact = replace(sensor.contact, bonded=("rim",), rim_width=RIM)
    return replace(sensor, name="tacprint_fingertip", contact=contact, assumptions=assumptions)
