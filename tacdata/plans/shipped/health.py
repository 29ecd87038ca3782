"""Some ten presses that show the state of a unit, the same at each visit: visits are compared press by press.

- rest stretch: noise of every channel, and drift without contact;
- sites: one press for each two by two taxels, off centre, so that no two channels give the same answers to all of them;
- reference: one press again and again through the visit: hysteresis and repeatability;
- slow reference: the same at a quarter of the speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.plans.shipped.shipped_plan import MOTION, PlanOptions, ShippedPlan, block, from_recipe, points
from tacdata.plans.specimens import specimens
from tacdata.sensor import Sensor

DEPTH = 0.8
"""Depth of every press [mm]."""
SPEEDS = (1.0, 0.25)
"""Speed of the presses, and of the slow one [mm/s]."""
REST, HOLD = 20.0, 1.0
"""Length of the rest stretch and of the holds [s]."""
REPEATS = 3
"""Reference presses after the sites; one more comes before them [count]."""
OFF_CENTRE = (0.15, 0.2)
"""Distance of a site from the centre of its four taxels along x and y [pitches], to one side and the other in turn:
each of the four answers otherwise, and neighbours do not keep their ratio from site to site."""
CLEARANCE = 0.5
"""Minimum distance of the indenter at full depth from the skin's rim [mm]."""


class Health(ShippedPlan):
    """Rest, a press near every taxel, one press repeated, and once slowly."""

    usual = ("sphere_4",)

    def document(self, sensor: Sensor, wishes: PlanOptions) -> dict[str, Any]:
        """Return the plan; ``purpose`` of each press names its block."""
        names = self.specimen_names(wishes, 1, "one, the same at every visit")
        places = _sites(sensor)
        middle = points(places[np.argmin(np.linalg.norm(places, axis=1))])
        reference = block(names[0], middle, [DEPTH], "reference")
        recipe = {
            "name": f"health-{names[0]}",
            "purpose": "how a unit is, compared with its other visits",
            "indenters": specimens(names),
            "motion": {**MOTION, "press_speed": SPEEDS[0], "hold": HOLD},
            "grouped": False,
            "blocks": [
                {**reference, "rest": REST, "purpose": "rest stretch, then reference"},
                {**reference, "at": points(places), "purpose": "sites"},
                {**reference, "repeats": REPEATS},
                {**reference, "speeds": [SPEEDS[1]], "purpose": "slow reference"},
            ],
        }
        return from_recipe(recipe, sensor, wishes.seed, CLEARANCE)


def _sites(sensor: Sensor) -> np.ndarray:
    """Return a place near every two by two taxels [mm], shape (n, 2), row by row."""
    taxels = sensor.taxels
    x, y = np.meshgrid(_middles(taxels.columns), _middles(taxels.rows), indexing="xy")
    side = (-1.0) ** np.add.outer(np.arange(x.shape[0]), np.arange(x.shape[1]))
    # Along an axis with one taxel there is no neighbour to press between.
    offset = np.array(OFF_CENTRE) * (np.array([taxels.columns, taxels.rows]) > 1)
    pitch = np.array([taxels.pitch_x, taxels.pitch_y])
    return ((np.stack([x, y], axis=-1) + side[..., None] * offset) * pitch).reshape(-1, 2)


def _middles(count: int) -> np.ndarray:
    """Return the middles of successive pairs of ``count`` taxels [pitches from the centre]; an odd one is a pair."""
    first = np.arange(0, count, 2)
    return first + np.where(first + 1 < count, 0.5, 0.0) - (count - 1) / 2
