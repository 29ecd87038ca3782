"""A short plan whose presses separate physical effects.

Each block separates one group of effects that are collinear in ordinary presses:

- idle stretch: drift, noise, warm-up of the electronics, without anything near the skin;
- fly-over: effects that move with the carriage or respond to an indenter near the skin without touching it;
- onset map: slow first contacts at three corners and the centre: zero error (constant), tilt (a plane), air gaps
  (each taxel its own), a seating gap (a dome);
- virgin site: repeats at a place never pressed before, then deeper, then as before: softening, set, wear-in;
- rates: three speeds over a decade at two sites, three depths: delay, filter, viscosity, rate-free hysteresis;
- long hold: a hold and a recovery of several time constants at two depths: relaxation to a plateau against baseline
  tracking to zero;
- sides: the same place approached from +x, -x, +y, -y, and from below (overshoot): backlash against hysteresis;
- taxels: on and between taxels: gain of a channel against a property of the place;
- reference: the same press again and again through the session: everything that follows the clock;
- a second radius: rates and depths again: frame compliance, stiffening, poroelasticity, indenter shape;
- the first indenter turned by 180 deg: a tilted indenter against a shifted or tilted sensor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.plans.shipped.shipped_plan import MOTION, PlanOptions, ShippedPlan, block, from_recipe, points
from tacdata.plans.sites import half_box
from tacdata.plans.specimens import specimens
from tacdata.sensor import Sensor

DEPTHS = [0.4, 0.7, 1.0]
"""Depths of the rate presses [mm]."""
SPEEDS = [0.1, 0.5, 2.0]
"""Speeds of the rate presses [mm/s]: more than a decade."""
IDLE = 60.0
"""Length of the idle stretch [s]."""
HOLD, RECOVERY = 60.0, 60.0
"""Length of the long holds and of the recoveries after them [s]."""
SIDES = ["+x", "-x", "+y", "-y"]
"""Sides from which a place is approached."""
ONSET_SPEED = 0.1
"""Speed of the slow first contacts [mm/s]."""
CLEARANCE = 0.5
"""Minimum distance of an indenter at full depth from the skin's rim [mm]."""


class Diagnostic(ShippedPlan):
    """Rates, holds, repeats, sides, radii, idle and fly-over."""

    usual = ("sphere_4", "sphere_2")

    def document(self, sensor: Sensor, wishes: PlanOptions) -> dict[str, Any]:
        """Return the plan; ``purpose`` of each press names its block."""
        first, second = names = self.specimen_names(wishes, 2, "two of one shape, for example sphere_4 and sphere_2")
        half, pitch = half_box(sensor), np.array([sensor.taxels.pitch_x, sensor.taxels.pitch_y])
        on = _nearest(sensor, -0.3 * half)
        between = _nearest(sensor, 0.3 * half) + pitch / 2 * (np.array([sensor.taxels.columns, sensor.taxels.rows]) > 1)
        virgin = half * [-0.8, 0.8]
        corners = half * [[0, 0], [-1, -1], [1, -1], [1, 1]]  # the fourth is the virgin site's
        reference = block(first, points(on), [0.7], "reference")
        # Both lengths are several time constants of a usual skin, so that a plateau shows.
        long_hold = {"purpose": "long hold and recovery", "holds": [HOLD], "recovery": RECOVERY}
        gaps = {"kind": "between", "count": 8} if sensor.taxels.count > 1 else {"kind": "center"}
        recipe = {
            "name": f"diagnostic-{first}-{second}",
            "purpose": "presses that tell physical effects apart",
            "indenters": specimens(names),
            "motion": {**MOTION, "press_speed": 0.5, "run_up": 1.0},
            "grouped": False,
            "blocks": [
                block(first, points(on), [-MOTION["clearance"] / 2], "idle stretch", holds=[IDLE]),
                *_light(first, corners),
                block(first, points(virgin), [0.6], "virgin site", repeats=6),
                block(first, points(virgin), [0.9, 0.6], "virgin site, then deeper"),
                reference,
                _rates(first, np.array([on, between])),
                reference,
                block(first, points(between), [DEPTHS[0], DEPTHS[-1]], **long_hold),
                reference,
                block(first, points(between), [0.7], "approach direction", approach_from=SIDES, repeats=2),
                block(first, points(on), [0.7], "approach from below", overshoot=0.3, repeats=2),
                block(first, {"kind": "taxels", "only": _every(sensor, 12)}, [0.4], "on taxels", order="random"),
                block(first, gaps, [0.4], "between taxels"),
                block(first, points(virgin), [0.6], "virgin site, after a rest"),
                reference,
                *_light(second, corners[:1]),
                _rates(second, np.array([on])),
                block(second, points(between), [DEPTHS[-1]], **long_hold),
                {**reference, "yaws": [180.0], "repeats": 2, "purpose": "turned indenter"},
            ],
        }
        return from_recipe(recipe, sensor, wishes.seed, CLEARANCE)


def _light(name: str, places: np.ndarray) -> list[dict[str, Any]]:
    return [
        block(name, points(places), [-0.2], "fly-over"),
        block(name, points(places), [0.3], "onset map", speeds=[ONSET_SPEED]),
    ]


def _rates(name: str, places: np.ndarray) -> dict[str, Any]:
    return block(name, points(places), DEPTHS, "rates", speeds=SPEEDS, order="random", rest=3.0)


def _nearest(sensor: Sensor, place: np.ndarray) -> np.ndarray:
    """Return the centre of the taxel nearest to a place [mm], shape (2,)."""
    centers = sensor.taxels.centers
    return centers[np.argmin(np.linalg.norm(centers - place, axis=1))]


def _every(sensor: Sensor, count: int) -> list[int]:
    """Return at most ``count`` taxels, spread over the array."""
    taxels = sensor.taxels.count
    return np.unique(np.linspace(0, taxels - 1, min(count, taxels)).round()).astype(int).tolist()
