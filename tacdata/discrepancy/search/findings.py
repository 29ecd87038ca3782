"""What the workflow found: the effects of the answer, and the model with and without them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.search.screen import Left, Tested
from tacdata.effects import Placed

NEEDED = 3.8
"""An effect that was chosen among all is named if the answer is worse by so many standard errors without it [1].

The best of some 150 independent columns lies beyond that once in a hundred times.
"""


@dataclass(frozen=True)
class Member:
    """One effect of the answer, with those that would do as well."""

    placed: Placed
    error: dict[str, float]
    """Standard error of each parameter, in its unit."""
    at_bound: tuple[str, ...]
    """Parameters at a physical bound."""
    rivals: tuple[str, ...]
    """Mechanisms that explain the episodes as well in its place."""
    margins: dict[str, float]
    """Rival effect -> by how many standard errors over episodes the member is better."""
    necessity: float
    """By how many standard errors over episodes the model is worse without it."""
    losses: dict[str, float] = field(default_factory=dict)
    """Rival effect -> by how much half the whitened energy is larger with it [nats]."""
    selected: float = 1.0
    """Share of resamplings of the episodes in which its mechanism explains most [1]."""
    decoys: float | None = None
    """Share of decoys, all effects with chance scores, that do as well [1]; None for what did not race them."""
    needed: float = NEEDED
    """From which necessity on it is named [1]."""


@dataclass(frozen=True)
class Judgement:
    """What was found."""

    gap: bool
    """Whether anything is missing."""
    tested: Tested
    members: tuple[Member, ...]
    left: Left
    """What is still predictable with the members in place."""
    explained: float
    """Gain of the members in half the whitened energy [nats]."""
    energy: tuple[np.ndarray, np.ndarray]
    """Half the whitened energy of each episode before and after [nats], each of shape (episodes,)."""
    values: np.ndarray
    """Whitened values behind each episode [1], shape (episodes,)."""
    problem: Problem
    """The model as it was given."""
    final: Problem
    """The model with the members in place."""
    gains: np.ndarray
    """Gain of each channel beyond the response's, as calibration finds it [1], shape (channels,); 0 if fitted, NaN for
    channels that these presses do not stir."""
    until: str = "decide"
    """The last step that was made, one of `tacdata.discrepancy.search.judge.STEPS`."""

    @property
    def share_left(self) -> float:
        """Share of what could be explained that the members leave [1]."""
        whole = self.left.gain + max(self.explained, 0.0)
        return self.left.gain / whole if whole > 0 else 0.0
