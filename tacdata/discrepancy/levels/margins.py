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


def beside_remainder(findings: Findings) -> tuple[BesideRemainder, ...]:
    """Return each effect's evidence, given the remainder, in the order of the answer.

    A remainder may absorb part of the difference between two effects. The other part must support the name.
    """
    if not findings.comparisons:
        return ()
    remaining, spreads = remainder(findings.final), constancies(findings)
    each = zip(findings.comparisons, spreads, strict=True)
    return tuple(
        replace(_held_against(findings, models, at, remaining), spreads=spread)
        for at, (models, spread) in enumerate(each)
    )


def _held_against(findings: Findings, models: RivalModels, at: int, remaining: Remainder) -> BesideRemainder:
    null, setting = findings.final.null, findings.problem.setting
    course = setting.course.reduced
    error_of_nothing = ModelError(remaining.columns, course, null) if remaining.columns.shape[2] else None
    if models.without.placed:
        error_of_nothing = _joined(ModelError.of(models.begin, models.without, null), remaining)
    need = j_statistic(models.current, models.without, models.pooled, error_of_nothing)
    margins = {}
    for name, rival in models.rivals.items():
        error = _joined(ModelError.of(models.begin, rival, null, len(models.without.placed)), remaining)
        margins[name] = j_statistic(models.current, rival, models.pooled, error)
    return BesideRemainder(need, margins)


def _joined(error: ModelError, remaining: Remainder) -> ModelError:
    """Return the model error of a model's equations together with the remainder."""
    return replace(error, columns=np.concatenate([error.columns, remaining.columns], axis=2))
