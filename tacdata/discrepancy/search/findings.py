"""Findings: the effects of the answer, and the model with and without them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.search.gauss_newton import Refined
from tacdata.discrepancy.search.j_test import Pooled
from tacdata.discrepancy.search.leftovers import Leftovers
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.search.score_tests import ScoreTests
from tacdata.effects import Placed

NAMED_Z = 3.8
"""Necessity: an effect that was chosen among all is named from so many standard errors on [1].

The best of some 150 independent columns is beyond that once in a hundred times.
"""
STEPS = ("gate", "locate", "fit", "decide")
"""Steps of the workflow, each of which may be the last.

- gate: is there anything to explain?
- locate: where the residual lives; nothing is fitted.
- fit: the best fit; no rivals, no leftovers.
- decide: all.
"""


@dataclass(frozen=True)
class FoundEffect:
    """One effect of the answer, with those that would do as well."""

    placed: Placed
    error: dict[str, float]
    """Standard error of each parameter, in its unit."""
    at_bound: tuple[str, ...]
    """Parameters at a physical bound."""
    rivals: tuple[str, ...]
    """Mechanisms that explain the episodes as well in its place."""
    margins: dict[str, float]
    """Rival effect -> by how many standard errors over episodes this one is better (J test)."""
    necessity: float
    """By how many standard errors over episodes the model is worse without it (J test)."""
    losses: dict[str, float] = field(default_factory=dict)
    """Rival effect -> by how much half the whitened sum of squares is larger with it [1]."""
    selected: float = 1.0
    """Share of bootstrap samples of the episodes in which its mechanism explains most [1]."""
    corrected_p: float | None = None
    """P-value corrected for all candidates [1]; None for findings of calibration, which did not race."""
    needed: float = NAMED_Z
    """From which necessity on it is named [1]."""
    selected_family: float = 1.0
    """As ``selected``, for its family [1]."""
    bought: float = float("inf")
    """By how much half the whitened sum of squares is larger without it [1]."""
    unphysical: tuple[str, ...] = ()
    """Those of its rivals that need an amplitude at a physical bound."""
    forms: dict[str, float] = field(default_factory=dict)
    """Other form of its mechanism -> by how many standard errors over episodes this one is better (J test)."""


@dataclass(frozen=True)
class RivalModels:
    """The models by which one effect of the answer was compared with its rivals."""

    begin: Setting
    """With the response of the model without it."""
    current: Refined
    """The answer."""
    without: Refined
    """The answer without the effect."""
    rivals: dict[str, Refined]
    """Rival effect -> the model with it in the place."""
    pooled: Pooled
    """Shrinkage priors."""


@dataclass(frozen=True)
class Findings:
    """Findings of the search."""

    gap: bool
    """Whether anything is missing."""
    tests: ScoreTests
    """Of all candidates with the model as it was given."""
    effects: tuple[FoundEffect, ...]
    """The effects of the answer."""
    left: Leftovers
    """Part that is still predictable with the effects in place."""
    explained: float
    """Fall of half the whitened sum of squares by the effects [1]."""
    energy: tuple[np.ndarray, np.ndarray]
    """Half the whitened sum of squares of each episode before and after [1], each of shape (episodes,)."""
    values: np.ndarray
    """Whitened values behind each episode [1], shape (episodes,)."""
    given: Problem
    """The model as it was given, with its own noise and all candidates."""
    problem: Problem
    """The same with the noise estimated under the answer; where there is an answer, it has no candidates."""
    final: Problem
    """The model with the effects in place."""
    limits: dict[str, float]
    """Effect -> detection limit given the answer [typical sizes]; inf where it is not excited."""
    gains: np.ndarray
    """Gain of each channel beyond the response's, as calibration finds it [1], shape (channels,); 0 if fitted, NaN for
    channels that these presses do not stir."""
    halves: np.ndarray
    """The same in the first and the second half of the session [1], shape (2, channels)."""
    until: str = "decide"
    """The last step that was made, one of `STEPS`."""
    comparisons: tuple[RivalModels, ...] = ()
    """Of each effect of the answer; empty where rivals were not tried."""
    path: tuple[str, ...] = ()
    """Effects in the order in which forward selection added them."""

    @property
    def share_left(self) -> float:
        """Share of the explainable sum of squares that the effects leave [1]."""
        explainable = self.left.gain + max(self.explained, 0.0)
        return self.left.gain / explainable if explainable > 0 else 0.0

    @property
    def loudness(self) -> float:
        """Mean square of the whitened residual of the model as it was given [noise floor]."""
        return 2 * float(self.energy[0].sum()) / max(float(self.values.sum()), 1.0)
