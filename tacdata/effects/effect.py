"""What an effect's file holds.

A file ``tacdata/effects/my_effect.py`` defines one class derived from `Effect`: class attributes say what it is,
`apply` does it to a `State` at its stage. At every amplitude's default it must change nothing. A parameter with a
``grid`` is a shape (a time constant, a width): it is tried at those values and refined later; any other is an
amplitude, in which the effect is nearly linear around 0.

What an effect is to the search for a missing one is class data, too (its traits): whether presses of one rate show
it, whether it follows the clock, what it is without a force reading. No other file names effects.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np

from tacdata import registry
from tacdata.chain import Course, Response, State

ROOM, BASE = "tacdata.effects", "effect"


@dataclass(frozen=True)
class Parameter:
    """A number of an effect."""

    name: str
    """Its name."""
    unit: str
    """Its unit; "1" for a pure number."""
    meaning: str
    """What it is."""
    typical: float
    """Size that would not surprise (the prior's standard deviation), in its unit."""
    low: float
    """Least physical value, in its unit."""
    high: float
    """Largest physical value, in its unit."""
    default: float = 0.0
    """Value at which the effect is not there."""
    grid: tuple[float, ...] = ()
    """Values to try of a shape parameter; empty for an amplitude."""
    per_channel: bool = False
    """Whether every channel has its own."""


class Family(StrEnum):
    """What kind of thing an effect is, as a lab would go about it. A verdict may name the family before the effect."""

    SKIN_MEMORY = "memory of the skin"
    """The skin relaxes, creeps, softens or wears."""
    FRICTION_AND_PLAY = "friction and play"
    """Readings or the tip hang back, whatever the rate."""
    DELAY_AND_FILTER = "delay and filtering"
    """Readings, or the guide, come late."""
    KINEMATICS = "kinematics"
    """The tip is elsewhere than the guide says."""
    CONTACT = "contact"
    """How the tool meets the skin, and the skin its support."""
    RESPONSE_CURVE = "stiffness and response curve"
    """How much a taxel says of how much depth."""
    DRIFT = "gain and offset in time"
    """Readings change with the clock or with temperature."""
    CROSSTALK = "crosstalk and spread"
    """Taxels say what happens at others."""
    SIMULATION = "simulation"
    """The simulation, not the world."""
    OTHER = "of no family"
    """A family of its own."""


class AtRest(StrEnum):
    """What becomes of an effect while the tip stands still. Presses of one rate show nothing else of it."""

    CATCHES_UP = "catches up"
    """It was behind, and is over soon: a delay, a filter."""
    FALLS_BACK = "falls back"
    """It was ahead, and is over at once: what grows with the rate itself."""
    STAYS = "stays"
    """It stays as it is: play, friction."""
    GOES_ON = "goes on"
    """It goes on slowly: creep."""
    RELAXES = "relaxes"
    """It goes on, and a hold as long as its time constant shows it: relaxation."""


class Growth(StrEnum):
    """What an effect grows with. Evenly spaced presses do not separate the two."""

    PRESSES = "presses"
    """The number of presses at a place."""
    TIME = "time"
    """The time since the beginning."""


class GainKind(StrEnum):
    """Which gain of the readings an effect is: calibration reads it off."""

    COMMON = "common"
    """One for all channels."""
    PER_CHANNEL = "per channel"
    """One for each channel."""


class LikeGain(StrEnum):
    """How like a common gain an effect is where no force is read."""

    EQUAL = "equal"
    """It is the same: calibration takes it up."""
    SIMILAR = "similar"
    """It is nearly the same: a common gain is not named beside it."""


class Scale(StrEnum):
    """Whose lengths an effect stretches. Without a third length, the two cannot be separated."""

    DRIVE = "drive"
    OBSERVER = "observer"
    """A camera's or a gauge's, known by its calibration."""


class Effect(ABC):
    """A physical effect that a model may lack."""

    title: ClassVar[str]
    """What it is, in words."""
    catalogue: ClassVar[tuple[str, ...]]
    """Its numbers in the catalogue: M skin, G geometry, K guide, T taxel, D data, E environment, S simulator."""
    stage: ClassVar[str]
    """Where it acts (`tacdata.chain.STAGES`)."""
    moves: ClassVar[tuple[str, ...]]
    """What it changes: tag, label, signal, force."""
    group: ClassVar[str]
    """Ambiguity group: effects that look alike in ordinary presses."""
    family: ClassVar[Family] = Family.OTHER
    """What kind of thing it is; the same for all forms of a mechanism."""
    equation: ClassVar[str]
    """What it does."""
    source: ClassVar[str]
    """Where the equation comes from."""
    experiment: ClassVar[str]
    """The experiment that separates it from its group."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Its numbers."""
    seen_by_tag: ClassVar[bool] = False
    """Whether a tag on the carriage sees it (kinematics only)."""
    by_channel: ClassVar[bool] = False
    """Whether it mixes channels, or treats each in a way of its own."""
    form_error: ClassVar[float] = 0.1
    """How far its equation may be off, over its contribution, as a standard deviation [1]; less where it is geometry,
    arithmetic or a clock rather than a law of a material."""
    distributed: ClassVar[bool] = True
    """Whether it may be of several sizes at once. A delay of several is a filter."""
    odds: ClassVar[float] = 1.0
    """How likely it is in a soft skin before any data, over an effect that is not rare [1]; less than 1 only where
    there is a physical reason."""
    mechanism: ClassVar[str] = ""
    """The name it shares with other functional forms of the same thing; empty: its own."""
    word: ClassVar[str] = ""
    """The mechanism as a person calls it; empty: its name with blanks. The same for all forms."""
    at_rest: ClassVar[AtRest | None] = None
    """For memory of the rate, which needs two rates of pressing, or a hold; the same for all forms."""
    times_by_radius: ClassVar[float | None] = None
    """For linear memory of load: power of the tool's radius by which its times grow [1]; None for all else."""
    memory_by_depth: ClassVar[bool] = False
    """For linear memory of load: whether what relaxes grows with depth."""
    grows_with: ClassVar[Growth | None] = None
    """For what grows from press to press; needs unevenly spaced presses."""
    follows_clock: ClassVar[bool] = False
    """Whether it shows in how episodes follow each other: drifting offsets look like it."""
    gain: ClassVar[GainKind | None] = None
    """For a gain of the readings."""
    like_gain: ClassVar[LikeGain | None] = None
    """For what needs a force reading to be separated from a common gain."""
    scale: ClassVar[Scale | None] = None
    """For a scale of lengths."""
    in_series: ClassVar[bool] = False
    """Whether it gives way in series with what is pressed. Specimens of other stiffness tell."""
    changes_skin: ClassVar[bool] = False
    """Whether labels are solved anew with another skin (`thickness_factor`)."""
    each_episode: ClassVar[bool] = False
    """Whether every episode has a small amount of its own, as errors of place: a nuisance beside other effects."""

    @property
    def name(self) -> str:
        """The file's name."""
        return type(self).__module__.rsplit(".", 1)[-1]

    @property
    def called(self) -> str:
        """The name that a verdict gives: the mechanism."""
        return self.mechanism or self.name

    @property
    def spoken(self) -> str:
        """The mechanism in words."""
        return self.word or self.called.replace("_", " ")

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """Parameters in which it is nearly linear."""
        return tuple(p for p in self.parameters if not p.grid)

    @property
    def shapes(self) -> tuple[Parameter, ...]:
        """Parameters that are tried on a grid."""
        return tuple(p for p in self.parameters if p.grid)

    @abstractmethod
    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after the effect.

        Args:
            state: Before it.
            values: Value of every parameter, 0-d, or of shape (channels,) where it is ``per_channel``.
        """

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return in words why such recordings cannot show it at all; empty if they may."""
        return ""

    def time_constant(self, values: dict[str, np.ndarray]) -> float:
        """Return how long a tip must stand until it is over [s]; 0 if it has no time constant."""
        return max((float(np.max(values[p.name])) for p in self.parameters if p.unit == "s"), default=0.0)

    def delay(self, values: dict[str, np.ndarray]) -> float:
        """Return by how much readings come later than what they belong to [s]; 0 for most effects."""
        return 0.0

    def nested(self, values: dict[str, np.ndarray]) -> Placed | None:
        """Return the model nested in it, with its values; None for most effects."""
        return None

    def thickness_factor(self, values: dict[str, np.ndarray]) -> float:
        """Return the skin's thickness over the nominal one [1]; 1 for most effects."""
        return 1.0

    def of_force(self, values: dict[str, np.ndarray]) -> dict[str, np.ndarray] | None:
        """Return values by which readings would change as the force does; None for most effects: they do already."""
        return None

    def remark(self, values: dict[str, np.ndarray]) -> str:
        """Return what finding it says of the recordings, with the remedy; empty for most effects."""
        return ""


@dataclass(frozen=True)
class Placed:
    """An effect with its numbers, ready to act."""

    effect: Effect
    values: dict[str, np.ndarray]
    """Value of every parameter."""

    @property
    def stage(self) -> str:
        """Where it acts."""
        return self.effect.stage

    @property
    def seen_by_tag(self) -> bool:
        """Whether a tag sees it."""
        return self.effect.seen_by_tag

    def act(self, state: State) -> State:
        """Return the state after it."""
        return self.effect.apply(state, self.values)


def load(name: str) -> Effect:
    """Return one effect by its file's name.

    Raises:
        UsageError: If there is none.
    """
    kind: type[Effect] = registry.load(ROOM, BASE, name, Effect)
    return kind()


def library() -> tuple[Effect, ...]:
    """Return every modelled effect, by name.

    Example:
        >>> from tacdata.effects import library, load
        >>> len(library()) > 40
        True
        >>> load("backlash").stage
        'kinematics'
    """
    return _library(registry.folders(ROOM))


@functools.cache
def _library(folders: tuple[str, ...]) -> tuple[Effect, ...]:
    """Return the effects of some folders, read once."""
    return tuple(load(name) for name in registry.names(ROOM, BASE))
