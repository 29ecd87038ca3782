"""Base class of the effects. A file of this folder holds one mechanism.

A file ``tacdata/effects/my_effect.py`` begins with one sentence, the title. Its first class is derived from `Effect`
and bears the file's name. Class attributes describe it, and `apply` changes a `State` at its stage. At the default of
every amplitude it must change nothing. A parameter with a ``grid`` is a shape (a time constant, a width): it is tried
at those values and refined later. Any other is an amplitude, in which the effect is nearly linear around 0.

Further classes of the file are other forms of the same mechanism. Their names are those of the classes in lower case:
`RelaxationRead` is the form ``relaxation_read`` of ``relaxation``. Verdicts record these names, so they are a format.

The role of an effect in the search is class data, too (its traits): whether presses of one rate show it, whether it
follows the clock, how it resembles a gain. No other file names effects.

Three numbers of a new effect need a judgement, not a measurement:

``form_error``
    Relative standard deviation of the contribution after the parameters are fitted. The search ignores a second effect
    that explains less than ``form_error ** 2`` of the energy of the first. 0.02 for geometry, arithmetic and clocks;
    0.05 for a description with few terms; 0.1 (default) for the law of a material. Compare two published laws of the
    same thing: their difference is the error of either.
``odds``
    Prior odds against a common effect. They only matter if two effects fit nearly as well: the margin between the two
    grows from z to sqrt(z^2 - 2 ln odds). 1 (default) unless physics makes the effect rare in soft skins; state that
    reason in a comment.
``distributed``
    True (default) if the skin or the rig may have the effect at several sizes at once, as a rubber has many time
    constants: then the same effect at other sizes is part of its model error. False for a single number, as a delay
    is: several delays at once are a filter, which is another effect.
"""

from __future__ import annotations

import functools
import re
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np

from tacdata import registry
from tacdata.chain import Course, Response, State
from tacdata.errors import UsageError

__all__ = ["Course", "Response", "State"]

ROOM, BASE = "tacdata.effects", "effect"
MEMORYLESS = "a fitted response takes up whatever has no memory"
"""Reason why recordings cannot show an effect without memory if the response was fitted to them."""

type Values = dict[str, np.ndarray]
"""Value of every parameter, 0-d, or of shape (channels,) if it is ``per_channel``."""


class Whole(StrEnum):
    """Quantity of the recordings that a parameter may be a share of."""

    DEEPEST = "the deepest press"
    """Depth of the deepest press [mm]."""
    HALF_STROKE = "half the stroke"
    """Half the range of depths [mm]."""
    RANGE = "the range of the readings"
    """Range of the readings of a place [their unit]."""


@dataclass(frozen=True)
class Parameter:
    """A number of an effect."""

    name: str
    """Its name."""
    unit: str
    """Its unit; "1" for a pure number."""
    meaning: str
    """Meaning."""
    typical: float
    """Usual size (standard deviation of the prior), in its unit."""
    low: float
    """Least physical value, in its unit."""
    high: float
    """Largest physical value, in its unit."""
    default: float = 0.0
    """Value at which the effect is absent."""
    grid: tuple[float, ...] = ()
    """Values to try of a shape parameter; empty for an amplitude."""
    per_channel: bool = False
    """Whether it has a value for each channel."""
    of: Whole | None = None
    """Quantity that it is a share of; None for none."""


class Family(StrEnum):
    """Kind of an effect, by where a lab would look first. A verdict may name the family before the effect."""

    SKIN_MEMORY = "memory of the skin"
    """The skin relaxes, creeps, softens or wears."""
    FRICTION_AND_PLAY = "friction and play"
    """Readings or the tip lag, independent of the rate."""
    DELAY_AND_FILTER = "delay and filtering"
    """Readings, or the guide, come late."""
    KINEMATICS = "kinematics"
    """The tip is not where the guide reports it."""
    CONTACT = "contact"
    """Contact of the tool with the skin, and of the skin with its support."""
    RESPONSE_CURVE = "stiffness and response curve"
    """Reading of a taxel as a function of depth."""
    DRIFT = "gain and offset in time"
    """Readings change with the clock or with temperature."""
    CROSSTALK = "crosstalk and spread"
    """Readings respond to loads on other taxels."""
    SIMULATION = "simulation"
    """Errors of the simulation."""
    OTHER = "of no family"
    """None of the others."""


class AtRest(StrEnum):
    """Course of an effect while the tip is at rest. At a single rate of pressing, only this distinguishes it."""

    CATCHES_UP = "catches up"
    """The lag ends soon: a delay, a filter."""
    FALLS_BACK = "falls back"
    """The excess ends at once: it grows with the rate itself."""
    STAYS = "stays"
    """It does not change: play, friction."""
    GOES_ON = "goes on"
    """It continues slowly: creep."""
    RELAXES = "relaxes"
    """It continues, and a hold as long as its time constant shows it: relaxation."""


class Growth(StrEnum):
    """Variable with which an effect grows. Evenly spaced presses do not separate the two."""

    PRESSES = "presses"
    """The number of presses at a place."""
    TIME = "time"
    """The time since the beginning."""


class GainKind(StrEnum):
    """Kind of gain of the readings: calibration measures it."""

    COMMON = "common"
    """One for all channels."""
    PER_CHANNEL = "per channel"
    """One for each channel."""


class LikeGain(StrEnum):
    """Similarity of an effect to a common gain without a force channel."""

    EQUAL = "equal"
    """The two are the same: calibration absorbs it."""
    SIMILAR = "similar"
    """The two are nearly the same: a common gain is not named together with it."""


class Scale(StrEnum):
    """Lengths that an effect stretches. Without a third length, the two cannot be separated."""

    DRIVE = "drive"
    OBSERVER = "observer"
    """A camera's or a gauge's, known by its calibration."""


class Effect(ABC):
    """A physical effect that a model may lack."""

    name: ClassVar[str]
    """The file's name for its first class; for another form, the class's name in lower case."""
    title: ClassVar[str]
    """One phrase: the docstring of the file, or that of the class for another form."""
    mechanism: ClassVar[str] = ""
    """Name shared by all forms of the same thing, which a verdict gives: by default the file's name."""
    stage: ClassVar[str]
    """Stage at which it acts (`tacdata.chain.STAGES`)."""
    moves: ClassVar[tuple[str, ...]]
    """Streams that it changes: tag, label, signal, force."""
    group: ClassVar[str]
    """Ambiguity group: effects that resemble each other in ordinary presses."""
    family: ClassVar[Family] = Family.OTHER
    """Kind of effect; the same for all forms of a mechanism."""
    equation: ClassVar[str]
    """Equation of `apply`."""
    source: ClassVar[str] = "standard form"
    """Origin of the equation."""
    experiment: ClassVar[str]
    """Experiment that separates it from its group."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Its numbers."""
    seen_by_tag: ClassVar[bool] = False
    """Whether a tag on the carriage sees it (kinematics only)."""
    by_channel: ClassVar[bool] = False
    """Whether it mixes channels, or differs between them."""
    memoryless: ClassVar[bool] = False
    """Whether the pose alone determines it: a response that was fitted to the recordings absorbs it."""
    form_error: ClassVar[float] = 0.1
    """Relative standard deviation of the equation's error, over its contribution [1] (see the top of this file)."""
    distributed: ClassVar[bool] = True
    """Whether it may have several sizes at once (see the top of this file)."""
    odds: ClassVar[float] = 1.0
    """Prior odds in a soft skin, against an effect that is not rare [1] (see the top of this file)."""
    word: ClassVar[str] = ""
    """The mechanism as a person calls it; empty: its name with blanks. The same for all forms."""
    at_rest: ClassVar[AtRest | None] = None
    """For memory of the rate, which needs two rates of pressing, or a hold; the same for all forms."""
    times_by_radius: ClassVar[float | None] = None
    """For linear memory of load: power of the tool's radius by which its times grow [1]; None for all else."""
    memory_by_depth: ClassVar[bool] = False
    """For linear memory of load: whether the relaxing share grows with depth."""
    grows_with: ClassVar[Growth | None] = None
    """For growth from press to press; needs unevenly spaced presses."""
    follows_clock: ClassVar[bool] = False
    """Whether it depends on the order of the episodes: drifting offsets resemble it."""
    gain: ClassVar[GainKind | None] = None
    """For a gain of the readings."""
    like_gain: ClassVar[LikeGain | None] = None
    """For an effect that needs a force reading to be separated from a common gain."""
    scale: ClassVar[Scale | None] = None
    """For a scale of lengths."""
    in_series: ClassVar[bool] = False
    """Whether it is a compliance in series with the pressed specimen. Specimens of other stiffness separate them."""
    changes_skin: ClassVar[bool] = False
    """Whether labels are solved again with another skin (`thickness_factor`)."""
    each_episode: ClassVar[bool] = False
    """Whether every episode has a small amount of it, as errors of place: a nuisance parameter of all other effects."""

    def __init_subclass__(cls) -> None:
        """Take names and title from the file."""
        file = cls.__module__.rsplit(".", 1)[-1]
        module = sys.modules[cls.__module__]
        cls.name = (
            re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower() if registry.public_classes(module, Effect) else file
        )
        cls.mechanism = cls.mechanism or file
        cls.__doc__ = cls.__doc__ or module.__doc__ or ""
        cls.title = cls.__doc__.split("\n")[0].removesuffix(".")

    @property
    def called(self) -> str:
        """The name that a verdict gives: the mechanism."""
        return self.mechanism

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
    def apply(self, state: State, values: Values) -> State:
        """Return the state after the effect.

        Args:
            state: State at its stage, without the effect.
            values: Value of every parameter, 0-d, or of shape (channels,) if it is ``per_channel``.
        """

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return the reason why such recordings cannot show it at all; empty if they may."""
        return MEMORYLESS if self.memoryless and response.fitted else ""

    def time_constant(self, values: Values) -> float:
        """Return the time at rest after which it is over [s]; 0 if it has no time constant."""
        return max((float(np.max(values[p.name])) for p in self.parameters if p.unit == "s"), default=0.0)

    def delay(self, values: Values) -> float:
        """Return the delay of the readings [s]; 0 for most effects."""
        return 0.0

    def nested(self, values: Values) -> Placed | None:
        """Return the nested model with its values; None for most effects."""
        return None

    def thickness_factor(self, values: Values) -> float:
        """Return the skin's thickness over the nominal thickness [1]; 1 for most effects."""
        return 1.0

    def of_force(self, values: Values) -> Values | None:
        """Return values by which readings would change as the force does; None for most effects: they do already."""
        return None

    def remark(self, values: Values) -> str:
        """Return its meaning for recordings, with the remedy; empty for most effects."""
        return ""


@dataclass(frozen=True)
class Placed:
    """An effect with its numbers."""

    effect: Effect
    values: Values
    """Value of every parameter."""

    @property
    def stage(self) -> str:
        """Stage at which it acts."""
        return self.effect.stage

    @property
    def seen_by_tag(self) -> bool:
        """Whether a tag sees it."""
        return self.effect.seen_by_tag

    def act(self, state: State) -> State:
        """Return the state after it."""
        return self.effect.apply(state, self.values)


def load(name: str) -> Effect:
    """Return an effect by the name of its file or form.

    Raises:
        UsageError: If there is none.
    """
    try:
        forms = registry.public_classes(registry.load_module(ROOM, BASE, name), Effect)
    except UsageError:
        # Forms have no file of their own: only the files know their names.
        for effect in library():
            if effect.name == name:
                return type(effect)()
        raise
    if not forms:
        raise UsageError(
            f"the file {name}.py of the effects defines no class derived from Effect",
            "one class, and one for each further form",
            f"derive the class in {name}.py from tacdata.effects.Effect",
        )
    return forms[0]()


def library() -> tuple[Effect, ...]:
    """Return every modelled effect, in all its forms, by name.

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
    files = (registry.load_module(ROOM, BASE, name) for name in registry.names(ROOM, BASE))
    forms = (form() for file in files for form in registry.public_classes(file, Effect))
    return tuple(sorted(forms, key=lambda effect: effect.name))
