"""Checks of the data, made once before anything is fitted: is their information sufficient, are they as stated?"""

from __future__ import annotations

from dataclasses import dataclass

from tacdata.chain import Course
from tacdata.chain.at_rest import always_touched
from tacdata.discrepancy.data.clocks import shifted
from tacdata.discrepancy.data.idle_lines import idle_lines
from tacdata.discrepancy.data.single_channels import odd_channels
from tacdata.discrepancy.data.sufficiency import FEWEST_EPISODES, limitations, shortcomings
from tacdata.discrepancy.data.wiring import miswired
from tacdata.discrepancy.model.response_curve import response_curve
from tacdata.discrepancy.model.setting import Setting

FITTED = (
    "the base was fitted to these recordings: what depends on the pose alone (stiffness, gain, thickness, offsets, "
    "compliance) is in it; to judge that, give a model of the sensor (--spec, --fem), for compliance a gauge at the tip"
)


@dataclass(frozen=True)
class DataChecks:
    """Remarks on the recordings themselves, as sentences."""

    episodes: int
    """Number of episodes."""
    wiring: tuple[str, ...] = ()
    """Channels that are not those of the model: no verdict."""
    shortcomings: tuple[str, ...] = ()
    """Faults of the recordings, each with its remedy."""
    base: tuple[str, ...] = ()
    """Open questions of the model that they are compared with."""
    watched: tuple[str, ...] = ()
    """Patterns of idle stretches and single channels that no effect of the library has."""
    clocks: tuple[str, ...] = ()
    """Delay of readings after the path: reported unless the verdict names a delay."""
    touched: tuple[str, ...] = ()
    """Readings that answer where nothing should press: no verdict."""
    early: tuple[str, ...] = ()
    """By how much they come early. A loop explains it."""
    limitations: tuple[str, ...] = ()
    """Questions that such a protocol cannot answer, each with its remedy."""

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Obstacles to any verdict on these recordings. A unit that was stated is believed: a doubt is a remark."""
        return (*self.wiring, *self.touched)

    @property
    def too_few(self) -> bool:
        """Whether there are too few episodes for a name."""
        return self.episodes < FEWEST_EPISODES


def check(setting: Setting) -> DataChecks:
    """Check recordings, and whether they are of the model's sensor."""
    course, response = setting.course, setting.response
    wiring = () if setting.given else tuple(miswired(course, response))
    is_late, words = shifted(course)
    return DataChecks(
        course.episodes,
        wiring,
        tuple(shortcomings(course)),
        _base(setting),
        (*idle_lines(course), *odd_channels(course, response)),
        words if is_late else (),
        _touched(course),
        () if is_late else words,
        tuple(limitations(course)),
    )


def _touched(course: Course) -> tuple[str, ...]:
    """Return a sentence if readings show contact on both sides of zero depth: half the path would be misjudged."""
    low = always_touched(course)
    if not low:
        return ()
    return (
        f"readings answer as much below zero, down to {low:.3g} mm, as above: depth has no side without contact. Count "
        f"it from the lowest (offset: {low:.3g} under depth, in the import's mapping)",
    )


def _base(setting: Setting) -> tuple[str, ...]:
    """Return the open questions of a fitted response, and the nearest contact law; empty for a model of the sensor."""
    if not setting.response.fitted:
        return ()
    curve = response_curve(setting.course)
    return (FITTED,) if curve is None else (FITTED, str(curve))
