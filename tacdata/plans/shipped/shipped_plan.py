"""Base class of a shipped plan.

``tacdata/plans/shipped/my_plan.py`` defines one class derived from `ShippedPlan`. Its name is the file's name, and
`tacdata plan my_plan` writes it for a sensor. Most are written most easily as a recipe (`tacdata.plans.recipe`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.sensor import Sensor

ROOM, BASE = "tacdata.plans.shipped", "shipped_plan"


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

    def specimen_names(self, wishes: PlanOptions) -> tuple[str, ...]:
        """Return the names of the specimens to use."""
        return wishes.indenters or self.usual


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
