"""From a course and an ordered list of effects to what the streams should say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tacdata.chain.course import Course
from tacdata.chain.response import Response
from tacdata.chain.state import STAGES, State

_BEFORE_SIGNAL = STAGES.index("taxel")


class Acting(Protocol):
    """An effect with its numbers."""

    @property
    def stage(self) -> str:
        """One of `STAGES`."""
        ...

    @property
    def seen_by_tag(self) -> bool:
        """Whether a tag on the carriage sees what a kinematic effect does."""
        ...

    def act(self, state: State) -> State:
        """Return the state after it."""
        ...


@dataclass(frozen=True)
class Prediction:
    """What a model says of every row."""

    signal: np.ndarray
    """Readings [the source's unit], shape (n, channels)."""
    force: np.ndarray
    """Normal force [the response's unit], shape (n,)."""
    tag: np.ndarray
    """x, y, depth that a tag sees [mm], shape (n, 3)."""
    pose: np.ndarray
    """x, y, depth of the tip as it is [mm], shape (n, 3): what the label belongs to."""


def predict(course: Course, response: Response, effects: Sequence[Acting]) -> Prediction:
    """Run the chain.

    Args:
        course: What was done; its readings are not looked at.
        response: What it starts from.
        effects: In any order; they act by stage, within a stage in the order given.
    """
    empty = np.empty(0)
    state = State(course, response, course.tip, empty, empty, empty)
    kinematic = [e for e in effects if e.stage == "kinematics"]
    for effect in (e for e in kinematic if e.seen_by_tag):
        state = effect.act(state)
    tag = state.pose
    for effect in (e for e in kinematic if not e.seen_by_tag):
        state = effect.act(state)
    state = replace(
        state,
        load=response.load(state.pose, course.tool),
        force=response.force(state.pose, course.tool),
    )
    for stage in STAGES[1:_BEFORE_SIGNAL]:
        state = _stage(state, stage, effects)
    force = state.force
    state = replace(state, signal=response.signal(state.load))
    for stage in STAGES[_BEFORE_SIGNAL:]:
        state = _stage(state, stage, effects)
    return Prediction(state.signal, force, tag, state.pose)


def _stage(state: State, stage: str, effects: Sequence[Acting]) -> State:
    for effect in effects:
        if effect.stage == stage:
            state = effect.act(state)
    return state
