"""Every number of the posterior and of the statuses: one record, hashed with the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from tacdata import provenance


@dataclass(frozen=True)
class Policy:
    """Priors, sizes of the search, and probabilities from which something has a name."""

    effects: float = 0.5
    """Prior: effects in a world, on average [1]."""
    freedom: float = 4.0
    """Prior of an amplitude: degrees of freedom of its t distribution about 0, one typical size wide [1]."""
    scales: tuple[float, ...] = (3.0, 1.0, 0.3, 0.1)
    """Prior of amplitudes that each channel has of its own: common widths, equally probable [typical sizes]."""
    sizes: tuple[float, ...] = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0)
    """Remainder: its prior's standard deviation [root of the largest information]."""
    quiet: float = 0.5
    """Remainder: prior probability that there is none [1]; the other sizes share the rest."""
    numerics: float = 3.0
    """Prior of the response's own error, over the difference of two grids [1]."""
    most: int = 4
    """Effects in a set, at most."""
    beam: int = 15
    """Beam: sets that are extended."""
    shapes: int = 2
    """Beam: shapes of one set of mechanisms that are extended."""
    first: int = 8
    """Sets that are refined on the chain in the first round..."""
    refined: int = 10
    """...and in every later one."""
    near: float = 10.0
    """Sets are refined if their evidence to first order is so near that of the best [1]..."""
    rough: float = 0.1
    """...or so near as a share of what the best one explains: evidence of large effects is rough there [1]."""
    far: float = 30.0
    """Samples of presses are drawn for sets whose evidence is so near that of the best [1]."""
    steps: int = 5
    """Gauss-Newton steps of a set in the first round, at most..."""
    later: int = 3
    """...and in later ones, which begin near the best set."""
    rounds: int = 3
    """Rounds of proposals about the best set."""
    bags: int = 24
    """Bootstrap samples of presses."""
    share: float = 0.8
    """Presses of a sample, as a share of all [1]: each sample leaves out a fold; 1: a bootstrap."""
    coarse: float = 0.5
    """The same where a remainder is probable, as the model is known to be wrong there [1]."""
    named: float = 0.95
    """Probability from which on an effect or a family has a name [1]."""
    there: float = 0.5
    """Probability, as presses scatter, from which an effect is part of the answer [1]."""
    none: float = 0.5
    """Probability of nothing at all from which on the status is none [1]."""
    remainder: float = 0.5
    """Probability of a remainder from which on a name is incomplete [1]."""
    least: float = 0.01
    """Probability from which on an alternative is listed [1]."""
    forms: float = 1.0
    """Prior of form errors, over what the effects' files state [1]."""
    seed: int = 0
    """Of the bootstrap."""

    def document(self) -> dict[str, Any]:
        """Return it as in the verdict."""
        return asdict(self)

    @property
    def content_hash(self) -> str:
        """What names this policy (hex)."""
        return provenance.content_hash(self.document())


POLICY = Policy()
"""As it is shipped."""
