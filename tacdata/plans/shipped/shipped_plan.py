"""Base class of a shipped plan.

``tacdata/plans/shipped/my_plan.py`` defines one class derived from `ShippedPlan`. Its name is the file's name, and
`tacdata plan my_plan` writes it for a sensor. Most are written most easily as a recipe (`tacdata.plans.recipe`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.plans.recipe import write_out
from tacdata.plans.sites import clear_of_rim
from tacdata.sensor import Sensor

ROOM, BASE = "tacdata.plans.shipped", "shipped_plan"
MOTION = {
    "clearance": 4.0,
    "standoff": 0.3,
    "travel_speed": 20.0,
    "approach_speed": 5.0,
    "press_speed": 0.7,
    "hold": 1.0,
    "rest": 1.0,
}
"""Usual motion of a plan (`schemas/plan.schema.json`)."""


@dataclass(frozen=True)
class PlanOptions:
    """Options of a person; None where they are left open."""

    presses: int | None = None
    """Number of presses."""
    indenters: tuple[str, ...] | None = None
    """Names in `tacdata.plans.specimens.STANDARD`."""
    seed: int = 0
    """Same seed, same plan."""


class ShippedPlan(ABC):
    """Base class: a plan that can be written for any sensor."""

    usual: ClassVar[tuple[str, ...]]
    """Default specimens."""
    adjustable: ClassVar[bool] = False
    """Whether the number of presses may be chosen."""

    @abstractmethod
    def document(self, sensor: Sensor, wishes: PlanOptions) -> dict[str, Any]:
        """Return the plan's document (`schemas/plan.schema.json`).

        Raises:
            UsageError: If an option cannot be met.
            FormatError: If the sensor is too small or too thin for the plan.
        """

    def specimen_names(self, wishes: PlanOptions, count: int | None = None, which: str = "") -> tuple[str, ...]:
        """Return the names of the specimens to use.

        Args:
            wishes: Options of a person.
            count: Number that the plan needs; None for any.
            which: The specimens it needs, in words, for the error.

        Raises:
            UsageError: If their number is another one.
        """
        names = wishes.indenters or self.usual
        if count not in (None, len(names)):
            plan = type(self).__name__.lower()
            raise UsageError(f"{len(names)} indenters for the {plan} plan", which, "give one --indenter for each")
        return names


def from_recipe(recipe: dict[str, Any], sensor: Sensor, seed: int, clearance: float) -> dict[str, Any]:
    """Return the plan's document of a recipe without version, its presses moved inwards from the skin's rim.

    Args:
        recipe: Entries of `schemas/plan_recipe.schema.json`.
        sensor: The skin.
        seed: Seed of random orders.
        clearance: Minimum distance of the indenter at full depth from the rim [mm].
    """
    document = write_out({"version": "1.0", **recipe}, sensor, f"plan {recipe['name']}", seed)
    # After the expansion, as each press has an indenter and a depth of its own.
    clear_of_rim(document["presses"], document["indenters"], sensor, clearance)
    return document


def block(indenter: str, at: dict[str, Any], depths: Sequence[float], purpose: str, **others: Any) -> dict[str, Any]:
    """Return a recipe's block; ``others`` are further entries of `schemas/plan_recipe.schema.json`."""
    return {"indenter": indenter, "at": at, "depths": [*depths], "purpose": purpose, **others}


def points(places: np.ndarray) -> dict[str, Any]:
    """Return the entry ``at`` of a recipe's block for places [mm], shape (2,) or (n, 2)."""
    return {"kind": "points", "points": np.round(np.atleast_2d(places), 3).tolist()}


def shipped_plan(name: str, sensor: Sensor, wishes: PlanOptions | None = None) -> dict[str, Any]:
    """Return the document of a shipped plan.

    Raises:
        UsageError: If there is none of that name, or an option cannot be met.

    Example:
        >>> from tacdata.plans.shipped.shipped_plan import PlanOptions, shipped_plan
        >>> from tacdata.sensor import default_sensor
        >>> document = shipped_plan("training", default_sensor(), PlanOptions(presses=6, seed=1))
        >>> len(document["presses"])
        6
        >>> list(document["indenters"])
        ['sphere_2', 'sphere_4', 'punch', 'pin', 'ellipsoid']
    """
    kind: type[Any] = registry.load(ROOM, BASE, name, ShippedPlan)
    plan: ShippedPlan = kind()
    wishes = wishes or PlanOptions()
    if wishes.presses is not None and not plan.adjustable:
        raise UsageError(
            f"{wishes.presses} presses of the plan {name}",
            "the number that the plan has",
            "leave --presses out, or take the plan training",
        )
    return plan.document(sensor, wishes)
