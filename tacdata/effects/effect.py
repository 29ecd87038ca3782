"""What an effect's file holds.

A file ``tacdata/effects/my_effect.py`` defines one class derived from `Effect`: class attributes say what it is,
`apply` does it to a `State` at its stage. At every amplitude's default it must change nothing. A parameter with a
``grid`` is a shape (a time constant, a width): it is tried at those values and refined later; any other is an
amplitude, in which the effect is nearly linear around 0.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from dataclasses import dataclass
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
    equation: ClassVar[str]
    """What it does."""
    source: ClassVar[str]
    """Where the equation comes from."""
    experiment: ClassVar[str]
    """What tells it from its group."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """Its numbers."""
    seen_by_tag: ClassVar[bool] = False
    """Whether a tag on the carriage sees it (kinematics only)."""
    by_channel: ClassVar[bool] = False
    """Whether it mixes channels, or treats each in a way of its own."""
    form_error: ClassVar[float] = 0.1
    """How far its equation may be off, over its contribution, as a standard deviation [1]; less where it is geometry,
    arithmetic or a clock rather than a law of a material."""
    odds: ClassVar[float] = 1.0
    """How likely it is in a soft skin before any data, over an effect that is not rare [1]; less than 1 only where
    there is a physical reason."""
    mechanism: ClassVar[str] = ""
    """The name it shares with other functional forms of the same thing; empty: its own."""

    @property
    def name(self) -> str:
        """The file's name."""
        return type(self).__module__.rsplit(".", 1)[-1]

    @property
    def called(self) -> str:
        """The name that a verdict gives: the mechanism."""
        return self.mechanism or self.name

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
        """Return in words why such recordings cannot tell of it at all; empty if they may."""
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


@functools.cache
def library() -> tuple[Effect, ...]:
    """Return every modelled effect, by name."""
    return tuple(load(name) for name in registry.names(ROOM, BASE))
