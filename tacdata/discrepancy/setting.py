"""What is judged, and with what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tacdata.chain import Course, Response
from tacdata.effects import Effect, Placed

NUISANCE = {"channel_gain": 0.05, "view_scale": 0.005}
"""What calibration leaves open: standard deviations in the effects' own units. Gains count where the response was not
fitted, a view's scale where there is one."""


@dataclass(frozen=True)
class Setting:
    """Recordings, a model of them, and the effects that may be missing in it."""

    course: Course
    response: Response
    effects: Sequence[Effect]
    """The library."""
    nuisance: dict[str, float] = field(default_factory=lambda: dict(NUISANCE))
    """Effect -> prior standard deviation."""
    given: tuple[Placed, ...] = ()
    """Effects that the model has already, with their numbers fixed."""
    decoys: bool = True
    """Whether effects race with copies of all by chance; without, each is tested alone (to see what that costs)."""
