"""Each effect of an answer, given a remainder: is its size the same in all conditions, and how far are its rivals?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from tacdata.discrepancy.levels.constancy import constancies
from tacdata.discrepancy.levels.remainder import Remainder, remainder
from tacdata.discrepancy.search.findings import Findings, RivalModels
from tacdata.discrepancy.search.j_test import ModelError, j_statistic


class Level(Enum):
    """How fine a name is; the value is the word in a verdict's file."""

    FAMILY = "family"
    MECHANISM = "mechanism"
    FORM = "form"


@dataclass(frozen=True)
class BesideRemainder:
    """One effect's evidence, given a remainder of the residual's size."""

    necessity: float
    """By how many standard errors over episodes the model is worse without it (J test) [1]."""
    margins: dict[str, float]
    """Rival effect -> by how many standard errors over episodes this one is better (J test)."""
    spreads: dict[str, float] = field(default_factory=dict)
    """Condition -> spread of its size over that condition's parts [share of its size]."""


def beside_remainder(found: Findings) -> tuple[BesideRemainder, ...]:
    """Return each effect's evidence, given the remainder, in the order of the answer.

    A remainder may absorb part of the difference between two effects. The other part must support the name.
    """
    if not found.comparisons:
        return ()
    left, spreads = remainder(found.final), constancies(found)
    each = zip(found.comparisons, spreads, strict=True)
    return tuple(replace(_held_against(found, one, at, left), spreads=own) for at, (one, own) in enumerate(each))


def _held_against(found: Findings, one: RivalModels, at: int, left: Remainder) -> BesideRemainder:
    null, setting = found.final.null, found.problem.setting
    course = setting.course.reduced
    alone = ModelError(left.columns, course, null) if left.columns.shape[2] else None
    if one.without.placed:
        alone = _joined(ModelError.of(one.begin, one.without, null), left)
    need = j_statistic(one.current, one.without, one.pooled, alone)
    margins = {}
    for name, other in one.rivals.items():
        error = _joined(ModelError.of(one.begin, other, null, len(one.without.placed)), left)
        margins[name] = j_statistic(one.current, other, one.pooled, error)
    return BesideRemainder(need, margins)


def _joined(error: ModelError, left: Remainder) -> ModelError:
    """Return the model error of a model's equations together with the remainder."""
    return replace(error, columns=np.concatenate([error.columns, left.columns], axis=2))
