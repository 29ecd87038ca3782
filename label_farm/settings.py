"""Settings of a labelling run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from label_farm import environment
from label_farm.ledger.ledger import LEASE_SECONDS
from label_farm.presses import model
from label_farm.presses.ladder import Ladder
from label_farm.workers.engine import EngineMaker
from label_farm.workers.pool import Pool


@dataclass(frozen=True)
class FarmSettings:
    """How a session is labelled."""

    factory: str = model.FACTORY
    """Dotted path of what builds the skin model from a sensor."""
    ladder: Ladder = field(default_factory=Ladder)
    """How the states of a path are spaced."""
    uncertainty: bool = True
    """Whether labels say what the spreads that the sensor file states make of them; costs some two thirds more."""
    workers: int = field(default_factory=environment.cores)
    """Number of worker processes."""
    redo: bool = False
    """Replace labels of another model version, and try failed presses again."""
    lease_seconds: float = LEASE_SECONDS
    """How long a silent worker keeps its job [s]."""
    priority: int = 0
    """Larger comes first among the runs that share a store."""
    engine: EngineMaker = Pool
    """What runs the jobs: `pool.Pool`, or what makes another engine."""
    devices: Sequence[str] = ("cpu",)
    """What the workers solve on, one after the other."""
