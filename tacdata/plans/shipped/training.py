"""A training plan: random sites, depths and speeds, spread evenly over indenters and kinds of site."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata import documents, schemas
from tacdata.errors import UsageError
from tacdata.indenters import from_document
from tacdata.plans.shipped.shipped_plan import MOTION, PlanOptions, ShippedPlan
from tacdata.plans.sites import half_box
from tacdata.plans.specimens import specimens
from tacdata.sensor import Sensor

USUAL = ("sphere_2", "sphere_4", "punch", "pin", "ellipsoid")
"""Default indenters of a plan."""
YAWS: dict[str, tuple[float, ...]] = {
    "cylinder": (0.0, 60.0),
    "ellipsoid": (0.0, 60.0),
    "prism": (0.0, 60.0),
    "square_punch": (0.0, 45.0),
}
"""Mounting angles of shapes that are not round [deg]; each needs a change of indenter."""
DEPTHS = (0.3, 1.2)
"""Shallowest and deepest press [mm]."""
SPEEDS = (0.5, 1.0)
"""Slowest and fastest loading [mm/s]."""
HOLDS = (0.5, 1.0)
"""Shortest and longest hold [s]."""
CLEARANCE = 0.5
"""Minimum distance of an indenter at full depth from the skin's rim, which the frame holds [mm]."""
KINDS = ("taxel", "between", "anywhere", "edge")


class Training(ShippedPlan):
    """The standard training plan."""

    usual = USUAL
    adjustable = True

    def document(self, sensor: Sensor, wishes: PlanOptions) -> dict[str, Any]:
        """Return the plan; by default 24 presses."""
        return training_plan(
            sensor, 24 if wishes.presses is None else wishes.presses, wishes.seed, self.specimen_names(wishes)
        )


def training_plan(
    sensor: Sensor, presses: int = 24, seed: int = 0, indenters: tuple[str, ...] = USUAL
) -> dict[str, Any]:
    """Return a plan's document (`schemas/plan.schema.json`).

    Sites take turns among: on a taxel, half way between taxels, anywhere on the array, and at its edge. Depths are
    stratified: one in each of ``presses`` equal parts of `DEPTHS`. Presses are ordered by mounting, so that each
    indenter is mounted once per angle; within a mounting the order is random.

    Args:
        sensor: The skin that will be pressed.
        presses: Number of presses.
        seed: Same seed, same plan.
        indenters: Names in `tacdata.plans.specimens.STANDARD`.

    Raises:
        UsageError: If an indenter is unknown or there are no presses.
    """
    if presses < 1:
        raise UsageError(f"{presses} presses", "1 or more", "ask for one press or more")
    shapes = specimens(indenters)
    rng = np.random.default_rng(seed)
    mountings = [(name, yaw) for name in indenters for yaw in YAWS.get(shapes[name]["shape"], (0.0,))]
    depths = rng.permutation(DEPTHS[0] + (DEPTHS[1] - DEPTHS[0]) * (np.arange(presses) + rng.random(presses)) / presses)
    # Depth and kind of site must not depend on the mounting: both are dealt out in random order.
    kinds = rng.permutation([KINDS[k % len(KINDS)] for k in range(presses)])
    entries = []
    for k in range(presses):
        name, yaw = mountings[k % len(mountings)]
        depth = round(float(depths[k]), 3)
        x, y = _site(sensor, str(kinds[k]), rng, from_document(shapes[name]).footprint(depth, yaw))
        entries.append(
            {
                "indenter": name,
                "x": x,
                "y": y,
                "yaw": yaw,
                "depth": depth,
                "speed": round(float(rng.uniform(*SPEEDS)), 2),
                "hold": round(float(rng.uniform(*HOLDS)), 2),
            }
        )
    # Each mounting costs a person a minute.
    entries.sort(key=lambda entry: mountings.index((entry["indenter"], entry["yaw"])))  # ty: ignore[invalid-argument-type]
    used = [name for name in indenters if any(entry["indenter"] == name for entry in entries)]
    document = {
        "version": schemas.version("plan"),
        "name": f"training-{presses}-{seed}",
        "purpose": "random presses to train on",
        "indenters": {name: shapes[name] for name in used},
        "motion": {**MOTION, "hold": 0.7},
        "presses": entries,
    }
    for name in used:
        from_document(document["indenters"][name], name)
    documents.check(document, "plan", "training plan")
    return document


def _site(sensor: Sensor, kind: str, rng: np.random.Generator, footprint: tuple[float, float]) -> tuple[float, float]:
    """Return a site [mm, sensor frame] whose whole footprint [mm] keeps `CLEARANCE` from the skin's rim."""
    taxels, centers = sensor.taxels, sensor.taxels.centers
    half = half_box(sensor)
    pitch = np.array([taxels.pitch_x, taxels.pitch_y])
    rim = np.maximum(np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2 - footprint - CLEARANCE, 0.0)
    if kind == "taxel":
        site = centers[rng.integers(len(centers))]
    elif kind == "between":
        shift = pitch / 2 * rng.permuted([[1, 0], [0, 1], [1, 1]], axis=0)[0]
        site = np.clip(centers[rng.integers(len(centers))] + shift, -half, half)
    elif kind == "anywhere":
        site = rng.uniform(-half, half)
    else:
        site = rng.uniform(-half, half)
        axis = int(rng.integers(2))
        # Up to 0.4 pitches beyond the outermost taxels, on either side.
        site[axis] = (half[axis] + rng.uniform(0.0, 0.4) * pitch[axis]) * rng.choice([-1.0, 1.0])
    x, y = np.clip(site, -rim, rim)
    return round(float(x), 3), round(float(y), 3)
