"""The paper's evaluation: 78 depth trials and 40 contact-position trials.

Liu et al., TacPrint, section "Simulation-Generated Depth Labels" and Exp. 1. The depth at the contact centre is
compared over 78 trials. The centroid of the region above a threshold is compared over 40, three of which are cut by the
sensing boundary.

The paper prints neither depths, places nor indenters. The values here are assumptions with the same numbers of trials:
13 depths at 6 places, and 37 places spread over the interior with 3 at the edge.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.plans.shipped.shipped_plan import MOTION, PlanOptions, ShippedPlan, block, from_recipe, points
from tacdata.plans.sites import half_box
from tacdata.plans.specimens import specimens
from tacdata.sensor import Sensor

DEPTHS = [round(0.3 + 0.1 * k, 1) for k in range(13)]
"""Depths of the depth trials [mm]."""
PLACES = 6
"""Places at which each depth is pressed."""
INTERIOR, EDGE = 37, 3
"""Number of position trials whose contact is within the sensing area, and of those that its boundary cuts."""
POSITION_DEPTH = 0.8
"""Depth of the position trials [mm]."""
CLEARANCE = 0.1
"""Minimum distance of the indenter at full depth from the skin's rim [mm]; more would keep every contact whole."""


class Evaluation(ShippedPlan):
    """78 depth trials and 40 contact-position trials with one indenter."""

    usual = ("sphere_4",)

    def document(self, sensor: Sensor, wishes: PlanOptions) -> dict[str, Any]:
        """Return the plan; each press's ``purpose`` names its kind of trial."""
        names = self.specimen_names(wishes, 1, "one; write one plan for each")
        half = half_box(sensor)
        # Half a pitch, and a quarter, beyond the outermost centres: the sensing area cuts the contact.
        edge = half + np.array([sensor.taxels.pitch_x / 2, sensor.taxels.pitch_y / 4])
        interior = np.vstack([[0.0, 0.0], _spread(INTERIOR - 1) * (half - _margin(half))])
        cut = np.array([[edge[0], 0.3 * half[1]], [-edge[0], -0.3 * half[1]], [0.3 * half[0], edge[1]]])[:EDGE]
        places = np.vstack([[0.0, 0.0], _spread(PLACES - 1) * (half - _margin(half))])
        positions = points(np.vstack([interior, cut]))
        recipe = {
            "name": f"evaluation-{names[0]}",
            "purpose": "the paper's evaluation: 78 depth trials, 40 contact-position trials",
            "indenters": specimens(names),
            "motion": dict(MOTION),
            "blocks": [
                block(names[0], points(places), DEPTHS, "depth trial", order="random"),
                block(names[0], positions, [POSITION_DEPTH], "position trial", order="random"),
            ],
        }
        return from_recipe(recipe, sensor, wishes.seed, CLEARANCE)


def _margin(half: np.ndarray) -> np.ndarray:
    """Return the margin of interior places inside the array's box [mm], shape (2,): a fifth of its half sizes."""
    return 0.2 * half


def _spread(count: int) -> np.ndarray:
    """Return points spread evenly over [-1, 1]^2, shape (count, 2): Halton's sequence in bases 2 and 3."""
    from scipy.stats import qmc

    # Its first point is the origin of the unit square, a corner.
    return 2 * qmc.Halton(2, scramble=False).random(count + 1)[1:] - 1
