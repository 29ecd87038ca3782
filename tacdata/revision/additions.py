"""Effects of a verdict: those that the model gains, and those that are only shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.effects import Placed, load

DECIDED = ("named", "named, incomplete", "ambiguous")
"""Statuses of a verdict that may hold a name, beside what is open."""
FAMILY = "family"
"""Level of a name that leaves the mechanism open."""


@dataclass(frozen=True)
class Addition:
    """One effect of a verdict with its parameters."""

    placed: Placed
    entry: dict[str, Any]
    """Its entry in the verdict (`schemas/verdict.schema.json`, effects)."""

    @property
    def remark(self) -> str:
        """Reservation about the form; empty if the mechanism itself is named."""
        if self.entry["status"] != "named":
            return f"{self.placed.effect.name} is not named: added by request"
        if self.entry.get("level") != FAMILY:
            return ""
        family = self.entry.get("family", self.placed.effect.family.value)
        return f"named is the family {family}; {self.placed.effect.name} is its best form in these recordings"


def of_verdict(verdict: dict[str, Any]) -> list[Addition]:
    """Return every effect of a verdict, in its order."""
    return [
        Addition(
            Placed(load(e["effect"]), {n: np.array(p["value"], dtype=float) for n, p in e["parameters"].items()}), e
        )
        for e in verdict["effects"]
    ]


def additions(verdict: dict[str, Any]) -> list[Addition]:
    """Return the effects that the model gains: all that are named, whatever remains without a name."""
    if verdict["status"] not in DECIDED:
        return []
    return [a for a in of_verdict(verdict) if a.entry["status"] == "named"]


def suspects(verdict: dict[str, Any]) -> list[Addition]:
    """Return the effects that stay out of the model."""
    # Each call builds its own objects; the entries are the verdict's.
    added = {id(a.entry) for a in additions(verdict)}
    return [a for a in of_verdict(verdict) if id(a.entry) not in added]


def placed_of(effects: Sequence[Addition]) -> list[Placed]:
    """Return effects with their parameters, ready to act."""
    return [a.placed for a in effects]
