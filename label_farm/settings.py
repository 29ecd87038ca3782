"""Settings of a labelling run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tacdata.label_farm import environment
from tacdata.label_farm.ledger.ledger import LEASE_SECONDS
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.workers.engine import EngineMaker
from tacdata.label_farm.workers.pool import Pool


@dataclass(frozen=True)
class FarmSettings:
    """How a session is labelled."""

    factory: str = model.FACTORY
    """Dotted path of the function that builds the skin model of a sensor."""
    ladder: Ladder = field(default_factory=Ladder)
    """How the states of a path are spaced."""
    uncertainty: bool = True
    """Whether labels have uncertainties by the spreads of the sensor file; costs some two thirds more."""
    workers: int = field(default_factory=environment.cores)
    """Number of worker processes."""
    redo: bool = False
    """Replace labels of another model version, and try failed presses again."""
    lease_seconds: float = LEASE_SECONDS
    """How long a silent worker keeps its job [s]."""
    priority: int = 0
    """Larger comes first among the runs that share a store."""
    engine: EngineMaker = Pool
    """Engine of the jobs: `pool.Pool`, or a function that makes another one."""
    devices: Sequence[str] = ("cpu",)
    """Devices of the workers, one after the other."""
