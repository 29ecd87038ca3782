"""The gate: is there anything to explain at all?"""

from __future__ import annotations

from dataclasses import dataclass

from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.search.score_tests import ScoreTests, score_tests
from tacdata.discrepancy.search.shortlist import ALPHA

GATE = ALPHA
"""Largest p-value of a gap: of all candidates together, or of columns that belong to none [1]."""


@dataclass(frozen=True)
class Gate:
    """The model as it was given, tested."""

    problem: Problem
    tests: ScoreTests

    @property
    def gap(self) -> bool:
        """Whether the residual is more than noise."""
        return bool(min(self.tests.p.min(initial=1.0), self.tests.p_generic) <= GATE)


def gate(problem: Problem) -> Gate:
    """Test the residual of the model as it was given against all candidates, and against columns of no effect."""
    return Gate(problem, score_tests(problem))
