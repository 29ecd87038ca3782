"""Presses that could be recorded next, and their predicted readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.effects import Placed
from tacdata.errors import UsageError
from tacdata.recording.motion.press_steps import SHORTEST_PAUSE
from tacdata.revision.next_presses.machine import MachineLimits

HOLDS = (0.0, 2.0, 20.0)
"""Times at full depth to choose from [s]."""
DEPTHS, OVERSHOOT = (0.5, 1.0), 0.8
"""Depths as shares of the deepest recorded press; presses with overshoot go to its full depth and stay at this share.
"""
STROKES, STROKE = 30, (0.1, 0.3)
"""How often presses with strokes come up and go down again, and how far, as shares of their depth.

A delay, a filter and play differ where the tip starts, stops or turns, and nowhere else.
"""
RECOVERY = 10.0
"""Time after the release that may be recorded [s]."""
LONGEST = 3600.0
"""Longest press of a plan [s]."""
FRAME = 1 / 30
"""Time between readings if it is unknown [s]."""
PLACES = 2
"""Places tried for each tool, the most informative first."""


@dataclass(frozen=True)
class CandidatePress:
    """One press that could be recorded."""

    tool: int
    site: int
    """Place, as the course numbers them."""
    x: float
    """[mm]"""
    y: float
    """[mm]"""
    depth: float
    """[mm]"""
    speed: float
    """[mm/s]"""
    hold: float
    """[s]"""
    recovery: float
    """[s]"""
    overshoot: float
    """[mm]"""
    strokes: int = 0
    """[1]"""
    stroke: float = 0.0
    """[mm]"""

    @property
    def seconds(self) -> float:
        """Expected duration [s]."""
        turns = 2 * self.strokes * (self.stroke / self.speed + SHORTEST_PAUSE)
        return 4.0 + 2 * (self.depth + self.overshoot + 0.3) / self.speed + turns + self.hold + self.recovery

    def in_words(self, indenter: str) -> str:
        """Describe it."""
        text = f"{indenter} at ({self.x:.2f}, {self.y:.2f}) mm, {self.depth:.2f} mm deep at {self.speed:g} mm/s"
        text += f", from {self.overshoot:.2f} mm below" if self.overshoot else ""
        text += f", {self.strokes} times up by {self.stroke:.2f} mm and back" if self.strokes else ""
        text += f", hold {self.hold:g} s" if self.hold else ""
        return text + (f", {self.recovery:g} s after the release" if self.recovery else "")

    def entry(self, indenter: str, yaw: float) -> dict[str, Any]:
        """Return it as an entry of a plan."""
        fields: dict[str, Any] = {
            "indenter": indenter,
            "x": round(self.x, 3),
            "y": round(self.y, 3),
            "yaw": yaw,
            "depth": round(self.depth, 3),
            "speed": self.speed,
            "hold": self.hold,
        }
        if self.recovery:
            fields["recovery"] = self.recovery
        if self.overshoot:
            fields["overshoot"] = round(self.overshoot, 3)
        if self.strokes:
            fields |= {"strokes": self.strokes, "stroke": round(self.stroke, 3)}
        return fields


def trials(course: Course, machine: MachineLimits) -> list[CandidatePress]:
    """Return presses within the recorded range: its places, tools and depths, at speeds of the machine.

    Args:
        course: The recordings.
        machine: Its limits.
    """
    presses = []
    for tool in range(len(course.tools)):
        episodes = np.unique(course.episode[course.tool == tool])
        for site in _most_variable(course, episodes)[:PLACES]:
            local_episodes = [e for e in episodes if course.site[e] == site]
            rows = np.isin(course.episode, local_episodes)
            at = course.tip[rows][np.argmax(course.tip[rows, 2])]
            deepest = float(at[2])
            if deepest <= 0:
                continue
            # Every combination: rates, holds and depths each separate other pairs of effects.
            for share, speed, hold in product(DEPTHS, machine.rates, HOLDS):
                common = (tool, int(site), float(at[0]), float(at[1]))
                presses.append(CandidatePress(*common, share * deepest, speed, hold, 0.0, 0.0))
                if share == DEPTHS[-1] and hold == HOLDS[-1]:
                    # Recovery shows most after the longest hold at full depth.
                    presses.append(CandidatePress(*common, deepest, speed, hold, RECOVERY, 0.0))
                if share == DEPTHS[-1] and hold != HOLDS[-1]:
                    overshoot = (1 - OVERSHOOT) * deepest
                    presses.append(CandidatePress(*common, OVERSHOOT * deepest, speed, hold, 0.0, overshoot))
                if share == DEPTHS[-1] and hold == HOLDS[0]:
                    presses += [
                        CandidatePress(*common, deepest, speed, hold, 0.0, 0.0, STROKES, s * deepest) for s in STROKE
                    ]
    return presses


def _most_variable(course: Course, episodes: np.ndarray) -> list[int]:
    """Return the places of some episodes, the most variable readings first."""
    spread = {}
    for e in episodes:
        rows = (course.episode == e) & (course.averaged > 0)
        spread[int(course.site[e])] = max(
            spread.get(int(course.site[e]), 0.0), float(np.nanstd(course.readings[rows], axis=0).max())
        )
    return sorted(spread, key=lambda s: -spread[s])


def laid_out(course: Course, trial: CandidatePress, machine: MachineLimits) -> Course:
    """Return the course of one press that was not recorded; its readings are 0.

    Args:
        course: The recordings: readings come as often.
        trial: The press.
        machine: Its limits: acceleration rounds the corners of the path.

    Raises:
        UsageError: If the press is longer than `LONGEST`.
    """
    at, depth = _path(trial, machine)
    if not at[-1] <= LONGEST:
        raise UsageError(
            f"a press of {at[-1]:.3g} s, at the rates of these recordings",
            f"{LONGEST:g} s or less",
            "record presses that move, then plan again",
        )
    # Within episodes: between them a step is a pause.
    inside = course.reduced.step[~course.reduced.first]
    frame = float(np.clip(np.median(inside), 1e-3, 0.1)) if len(inside) else FRAME
    # Rounded alike, so that a corner that falls on a frame makes one row.
    at, frames = np.round(at, 9), np.round(np.arange(0.0, at[-1], frame), 9)
    time = np.unique(np.concatenate([frames, at]))
    tip = np.column_stack([np.full(len(time), trial.x), np.full(len(time), trial.y), np.interp(time, at, depth)])
    rows = len(time)
    return replace(
        course,
        time=time,
        episode=np.zeros(rows, dtype=np.int64),
        tip=tip,
        tool=np.full(rows, trial.tool, dtype=np.int64),
        readings=np.zeros((rows, course.channels)),
        averaged=np.isin(time, frames).astype(float),
        session=np.zeros(1, dtype=np.int64),
        site=np.array([trial.site]),
        names=("trial",),
        recording=None,
        restarts=None,
        force=None,
        tag=None,
        temperature=None if course.temperature is None else np.full(rows, float(np.median(course.temperature))),
    )


def _path(trial: CandidatePress, machine: MachineLimits) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and depths [mm] of a press, straight in between."""
    times, depths = [np.zeros(1)], [np.array([machine.lowest])]

    def stay(seconds: float) -> None:
        times.append(times[-1][-1:] + seconds)  # ty: ignore[invalid-argument-type]
        depths.append(depths[-1][-1:])

    def go(depth: float) -> None:
        begin = np.array([0.0, 0.0, float(depths[-1][-1])])
        at, places = machine.limits.straight_move(begin, np.array([0.0, 0.0, depth]), trial.speed).knots()
        times.append(times[-1][-1] + at)
        depths.append(places[:, 2])

    stay(1.0)
    go(trial.depth + trial.overshoot)
    if trial.overshoot:
        go(trial.depth)
    for _ in range(trial.strokes):
        for depth in (trial.depth - trial.stroke, trial.depth):
            stay(SHORTEST_PAUSE)
            go(depth)
    stay(trial.hold)
    go(machine.lowest)
    stay(0.5 + trial.recovery)
    return np.concatenate(times), np.concatenate(depths)


def predicted_readings(
    course: Course, response: Response, placed: Sequence[Placed], trial: CandidatePress, layout: Course
) -> np.ndarray:
    """Return the predicted readings of a trial, shape (readings, channels).

    Args:
        course: The recordings.
        response: A model's response.
        placed: Its effects.
        trial: The press.
        layout: Its course (`laid_out`).
    """
    return predict(layout, elsewhere(response, course, layout, trial), placed).signal[layout.read]


def elsewhere(response: Response, course: Course, layout: Course, trial: CandidatePress) -> Response:
    """Return a response for another course, at a known place and tool."""
    if not isinstance(response, FittedResponse):
        return response
    alike = np.flatnonzero((course.row_site == trial.site) & (course.tool == trial.tool))
    return response.of_place(int(response.context[alike[0]]), layout)
