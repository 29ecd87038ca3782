"""From a course and an ordered list of effects to the expected streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tacdata.chain.course import Course
from tacdata.chain.response import Response
from tacdata.chain.state import STAGES, State

_AFTER_POSE, _BEFORE_SIGNAL = STAGES.index("mechanics"), STAGES.index("taxel")


class Acting(Protocol):
    """An effect with its numbers."""

    @property
    def stage(self) -> str:
        """One of `STAGES`."""
        ...

    @property
    def seen_by_tag(self) -> bool:
        """Whether a tag on the carriage sees the kinematic effect."""
        ...

    def act(self, state: State) -> State:
        """Return the state after it."""
        ...


@dataclass(frozen=True)
class Prediction:
    """A model's prediction of every row."""

    signal: np.ndarray
    """Readings [the source's unit], shape (n, channels)."""
    force: np.ndarray
    """Normal force [the response's unit], shape (n,)."""
    tag: np.ndarray
    """x, y, depth that a tag sees [mm], shape (n, 3)."""
    pose: np.ndarray
    """x, y, depth of the true tip [mm], shape (n, 3), to which the label belongs."""


class Chain:
    """The chain run once, every step kept: run again with other effects, it begins where they first differ."""

    def __init__(self, course: Course, response: Response, effects: Sequence[Acting]) -> None:
        """Run the chain.

        Args:
            course: The paths; their readings are not used.
            response: The response at the start; must not change.
            effects: In any order; they act by stage, within a stage in the order given.
        """
        empty = np.empty(0)
        self._steps = _steps(effects)
        self._runs = [_Run(State(course, response, course.tip, empty, empty, empty), empty)]
        for step in self._steps:
            self._runs.append(_after(self._runs[-1], step))

    @property
    def prediction(self) -> Prediction:
        """The model's prediction."""
        return _said(self._runs[-1])

    def again(self, effects: Sequence[Acting]) -> Prediction:
        """Return the prediction with other effects; only the stages from the first difference on are run."""
        steps, common = _steps(effects), 0
        while common < min(len(steps), len(self._steps)) and steps[common] is self._steps[common]:
            common += 1
        run = self._runs[common]
        for step in steps[common:]:
            run = _after(run, step)
        return _said(run)


def predict(course: Course, response: Response, effects: Sequence[Acting]) -> Prediction:
    """Run the chain.

    Args:
        course: The paths; their readings are not used.
        response: The response at the start.
        effects: In any order; they act by stage, within a stage in the order given.
    """
    return Chain(course, response, effects).prediction


@dataclass(frozen=True)
class _Run:
    """The state after a step, with the parts kept from before."""

    state: State
    force: np.ndarray


_TAG, _LOAD, _SIGNAL = "the tag is seen", "the skin is loaded", "the load is read"


def _steps(effects: Sequence[Acting]) -> list[Acting | str]:
    """Return effects in the order in which they act, with the steps of the response between them."""
    by_stage = {stage: [e for e in effects if e.stage == stage] for stage in STAGES}
    kinematic = by_stage["kinematics"]
    return [
        # First what moves carriage and tag alike, then what moves the tip alone.
        *(e for e in kinematic if e.seen_by_tag),
        _TAG,
        *by_stage["view"],
        *(e for e in kinematic if not e.seen_by_tag),
        _LOAD,
        *(e for stage in STAGES[_AFTER_POSE:_BEFORE_SIGNAL] for e in by_stage[stage]),
        _SIGNAL,
        *(e for stage in STAGES[_BEFORE_SIGNAL:] for e in by_stage[stage]),
    ]


def _after(run: _Run, step: Acting | str) -> _Run:
    state = run.state
    if not isinstance(step, str):
        return replace(run, state=step.act(state))
    if step is _TAG:
        return replace(run, state=replace(state, view=state.pose))
    if step is _LOAD:
        tool = state.course.tool
        load, force = state.response.load(state.pose, tool), state.response.force(state.pose, tool)
        return replace(run, state=replace(state, load=load, force=force))
    # The force is taken here: the stages after it change readings alone.
    return replace(run, state=replace(state, signal=state.response.signal(state.load)), force=state.force)


def _said(run: _Run) -> Prediction:
    return Prediction(run.state.signal, run.force, run.state.view, run.state.pose)
