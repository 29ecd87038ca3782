"""Input of a judgement: course, response, effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tacdata.chain import Course, Response
from tacdata.effects import Effect, GainKind, LikeGain, Placed, library, load

NUISANCE = {"channel_gain": 0.05}
"""Calibration uncertainty of a response that was not fitted: standard deviations in the effects' own units."""


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

    @property
    def channel_gain(self) -> Effect | None:
        """The nuisance that is a gain of each channel; None without one, or where the response is fitted."""
        if self.response.fitted:
            return None
        return next((e for e in map(load, self.nuisance) if e.gain is GainKind.PER_CHANNEL), None)

    @property
    def absorbed(self) -> frozenset[str]:
        """Effects that calibration absorbs: nuisances, and the common factor of all channels' gains."""
        if self.response.fitted:
            return frozenset()
        force = self.course.force is not None
        common = {
            e.name for e in library() if e.gain is GainKind.COMMON or (e.like_gain is LikeGain.EQUAL and not force)
        }
        return frozenset(self.nuisance) | common
