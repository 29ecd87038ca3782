"""What is judged, and with what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tacdata.chain import Course, Response
from tacdata.effects import Effect, Placed

NUISANCE = {"channel_gain": 0.05}
"""What calibration leaves open of a response that was not fitted: standard deviations in the effects' own units."""


@dataclass(frozen=True)
class Setting:
    """Recordings, a model of them, and the effects that may be missing in it."""

    course: Course
    response: Response
    effects: Sequence[Effect]
    """The library."""
    nuisance: dict[str, float] = field(default_factory=lambda: dict(NUISANCE))
    """Effect -> prior standard deviation, for a response that is not fitted."""
    given: tuple[Placed, ...] = ()
    """Effects that the model has already, with their numbers fixed."""
    decoys: bool = True
    """Whether effects race with copies of all by chance; without, each is tested alone (to see what that costs)."""
