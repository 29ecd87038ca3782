"""The conclusion: a status and names, read off the probabilities of the posterior, as one typed record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from tacdata.chain import Response
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.data.checks import DataChecks
from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.estimates import Estimate
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.report.sealed_gap import Gap
from tacdata.discrepancy.search.problem import Problem
from tacdata.effects import Placed


class Status(StrEnum):
    """The most that recordings allow to be stated."""

    NAMED = "named"
    """Every effect of the most probable set has a name, and a remainder is improbable."""
    INCOMPLETE = "named, incomplete"
    """An effect or a family has a name, and something else is there."""
    AMBIGUOUS = "ambiguous"
    """Some effect is there; several may be it."""
    UNKNOWN = "unknown"
    """Something is there that no effect of the library explains."""
    NONE = "none"
    """Nothing is missing that these recordings would show."""


class Reason(StrEnum):
    """Why a status was given."""

    CONTRADICTION = "contradiction"
    """The recordings contradict the model's wiring, or units: unknown."""
    TOO_FEW = "too few"
    """Too few presses: unknown."""
    QUIET = "quiet"
    """Nothing at all is probable, and no alarm rings: none."""
    NAMED = "named"
    """Every effect has a name."""
    OPEN = "open"
    """Several mechanisms are probable in an effect's place: ambiguous, or incomplete."""
    REMAINDER = "remainder"
    """A remainder that no effect explains is probable: incomplete, or unknown."""
    SEALED = "sealed"
    """Sealed presses refute the set, or do not show it: unknown, or ambiguous."""
    ODD = "odd"
    """Some presses are unlike all others, and no effect is probable: unknown."""
    STOPPED = "stopped"
    """The judgement ended before its last step."""
    ALARM = "alarm"
    """No effect is probable, but an alarm shows a pattern outside the library: unknown."""


class Step(StrEnum):
    """Last step of a judgement."""

    GATE = "gate"
    """Is anything missing? No effect is tried: a remainder is weighed against nothing."""
    LOCATE = "locate"
    """The same, and where the residual is large."""
    FIT = "fit"
    """The sets that are best to first order."""
    DECIDE = "decide"
    """All."""


class Level(StrEnum):
    """How fine a name is."""

    FAMILY = "family"
    MECHANISM = "mechanism"
    FORM = "form"


class Certainty(StrEnum):
    """Whether one effect has a name."""

    NAMED = "named"
    """At its level."""
    AMBIGUOUS = "ambiguous"
    """It or one of its alternatives is there."""
    SUSPECTED = "suspected"
    """It may be there."""


@dataclass(frozen=True)
class Named:
    """One effect of the most probable set, or a gain beyond calibration."""

    placed: Placed
    at: int
    """Its place in the set; -1 for a gain beyond calibration."""
    probability: float
    """Of its mechanism [1]."""
    family: float
    """Of its family [1]."""
    form: float
    """Of its form [1]."""
    level: Level | None
    """The finest level that has a name; None: it is open."""
    alternatives: tuple[str, ...]
    """Mechanisms in its place, the most probable first; with it they hold the probability of a name."""
    certainty: Certainty = Certainty.SUSPECTED
    """Named, ambiguous or suspected; an effect of a verdict `unknown` is suspected."""
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    """Parameter -> value, standard error, 90 % interval, in its unit."""
    bought: float = 0.0
    """Rise of half the whitened sum of squares without it [1]."""
    by_calibration: bool = False
    """Whether it is a gain beyond the tolerance of calibration: it has no probability among the sets."""


@dataclass(frozen=True)
class SetProbability:
    """One set of effects."""

    placed: tuple[Placed, ...]
    """Its effects at their optimum; empty: no effect."""
    probability: float
    """Of the set [1]."""
    log_evidence: float
    """Natural logarithm of its evidence with its prior, over that of the empty set [1]."""
    estimates: tuple[Mapping[str, Estimate], ...] = ()
    """Of each effect: parameter -> estimate."""


@dataclass(frozen=True)
class Fit:
    """A model with its effects, for residuals."""

    problem: Problem
    """Setting, noise and residual of the open presses: `whitened_residual(problem)`, `slices(problem)`."""
    response: Response
    placed: tuple[Placed, ...]
    """Effects of the model and of the set, gains beyond calibration among them: `predict(course, response, placed)`."""
    energy: np.ndarray
    """Half the whitened sum of squares of each press, nuisances fitted [1], shape (presses,)."""


@dataclass(frozen=True)
class Conclusion:
    """What the posterior, the checks, the alarms and the sealed presses allow to be stated."""

    status: Status
    reason: Reason
    effects: tuple[Named, ...]
    """Of the most probable set, in its order, then gains beyond calibration."""
    best: Optimum
    """The most probable set."""
    sets: tuple[SetProbability, ...] = ()
    """Sets with a probability of at least `policy.least`, the most probable first."""
    mechanisms: Mapping[str, float] = field(default_factory=dict)
    """Mechanism -> its probability [1], the largest first."""
    families: Mapping[str, float] = field(default_factory=dict)
    """Family -> the probability that any of its mechanisms is there [1]."""
    nothing: float = 0.0
    """Probability of neither an effect nor a remainder [1]."""
    remainder: float = 0.0
    """Probability of a remainder that no effect explains [1]."""
    sizes: Mapping[float, float] = field(default_factory=dict)
    """Size of the remainder [root of the largest information] -> its probability [1]."""
    lacking: Mapping[str, float] = field(default_factory=dict)
    """Family -> by how much its saturated model raises the log-evidence beside the set [1]."""
    alarms: tuple[Alarm, ...] = ()
    """Patterns of the residual outside the library."""
    checks: DataChecks | None = None
    """Checks of the recordings."""
    sealed: Gap | None = None
    """Gap on sealed presses; None without any."""
    before: Fit | None = None
    """The model as it was given, with the noise of the set."""
    after: Fit | None = None
    """The model with the set in place."""
    given: Problem | None = None
    """The model as it was given, with its own noise and all candidates."""
    until: Step = Step.DECIDE
    """The last step that was made."""
    odd: tuple[int, ...] = ()
    """Presses unlike all others, by number."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Effect -> detection limit beside the set [typical sizes]; inf where it is not excited."""
    policy: Policy = field(default_factory=Policy)
    """Every number that decided; `policy.content_hash` is written with the verdict."""

    @property
    def surest_first(self) -> list[Named]:
        """The effects in reading order: named, ambiguous, suspected; of each the most probable first."""
        order = list(Certainty)
        return sorted(self.effects, key=lambda e: (order.index(e.certainty), -e.probability))

    @property
    def named(self) -> list[Named]:
        """Effects with a name at some level."""
        return [e for e in self.effects if e.certainty is Certainty.NAMED]
