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
from tacdata.plans import Plan

RATES, HOLDS = (0.15, 0.5, 2.0, 6.0), (0.0, 2.0, 20.0)
"""Speeds [mm/s] and times at full depth [s] to choose from."""
DEPTHS, OVERSHOOT = (0.5, 1.0), 0.8
"""Depths as shares of the deepest recorded press; presses with overshoot go to its full depth and stay at this share.
"""
RECOVERY = 10.0
"""Time after the release that may be recorded [s]."""
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

    @property
    def seconds(self) -> float:
        """Expected duration [s]."""
        return 4.0 + 2 * (self.depth + self.overshoot + 0.3) / self.speed + self.hold + self.recovery

    def in_words(self, indenter: str) -> str:
        """Describe it."""
        told = f"{indenter} at ({self.x:.2f}, {self.y:.2f}) mm, {self.depth:.2f} mm deep at {self.speed:g} mm/s"
        told += f", from {self.overshoot:.2f} mm below" if self.overshoot else ""
        told += f", hold {self.hold:g} s" if self.hold else ""
        return told + (f", {self.recovery:g} s after the release" if self.recovery else "")

    def entry(self, indenter: str, yaw: float) -> dict[str, Any]:
        """Return it as an entry of a plan."""
        found: dict[str, Any] = {
            "indenter": indenter, "x": round(self.x, 3), "y": round(self.y, 3), "yaw": yaw,
            "depth": round(self.depth, 3), "speed": self.speed, "hold": self.hold,
        }  # fmt: skip
        if self.recovery:
            found["recovery"] = self.recovery
        if self.overshoot:
            found["overshoot"] = round(self.overshoot, 3)
        return found


def trials(course: Course, plan: Plan) -> list[CandidatePress]:
    """Return presses within what was recorded: its places, tools and depths, no faster than the guide travels.

    Args:
        course: The recordings.
        plan: The plan of one of its sessions: its travel speed is the guide's.
    """
    top = plan.motion.travel_speed
    rates = [r for r in RATES if r <= top]
    found = []
    for tool in range(len(course.tools)):
        own = np.unique(course.episode[course.tool == tool])
        for site in _most_variable(course, own)[:PLACES]:
            here = [e for e in own if course.site[e] == site]
            rows = np.isin(course.episode, here)
            at = course.tip[rows][np.argmax(course.tip[rows, 2])]
            deepest = float(at[2])
            if deepest <= 0:
                continue
            for share, speed, hold in product(DEPTHS, rates, HOLDS):
                common = (tool, int(site), float(at[0]), float(at[1]))
                found.append(CandidatePress(*common, share * deepest, speed, hold, 0.0, 0.0))
                if share == DEPTHS[-1] and hold == HOLDS[-1]:
                    found.append(CandidatePress(*common, deepest, speed, hold, RECOVERY, 0.0))
                if share == DEPTHS[-1] and hold != HOLDS[-1]:
                    over = (1 - OVERSHOOT) * deepest
                    found.append(CandidatePress(*common, OVERSHOOT * deepest, speed, hold, 0.0, over))
    return found


def _most_variable(course: Course, episodes: np.ndarray) -> list[int]:
    """Return the places of some episodes, the most variable readings first."""
    spread = {}
    for e in episodes:
        rows = (course.episode == e) & (course.averaged > 0)
        spread[int(course.site[e])] = max(
            spread.get(int(course.site[e]), 0.0), float(np.nanstd(course.readings[rows], axis=0).max())
        )
    return sorted(spread, key=lambda s: -spread[s])


def laid_out(course: Course, trial: CandidatePress) -> Course:
    """Return the course of one press that was not recorded; its readings are 0."""
    deep = trial.depth + trial.overshoot
    corners = [(-0.3, 1.0), (deep, (deep + 0.3) / trial.speed)]
    if trial.overshoot:
        corners.append((trial.depth, trial.overshoot / trial.speed))
    corners += [(trial.depth, trial.hold), (-0.3, (trial.depth + 0.3) / trial.speed), (-0.3, 0.5 + trial.recovery)]
    at = np.concatenate([[0.0], np.cumsum([seconds for _, seconds in corners])])
    depth = np.array([-0.3, *(d for d, _ in corners)])
    inside = course.reduced.step[~course.reduced.first]
    frame = float(np.clip(np.median(inside), 1e-3, 0.1)) if len(inside) else FRAME
    time = np.unique(np.concatenate([np.arange(0.0, at[-1], frame), at]))
    tip = np.column_stack([np.full(len(time), trial.x), np.full(len(time), trial.y), np.interp(time, at, depth)])
    rows = len(time)
    return replace(
        course, time=time, episode=np.zeros(rows, dtype=np.int64), tip=tip,
        tool=np.full(rows, trial.tool, dtype=np.int64), readings=np.zeros((rows, course.channels)),
        averaged=np.ones(rows), session=np.zeros(1, dtype=np.int64), site=np.array([trial.site]), names=("trial",),
        recording=None, force=None, tag=None, temperature=None if course.temperature is None else np.full(
            rows, float(np.median(course.temperature))),
    )  # fmt: skip


def predicted_readings(
    course: Course, response: Response, placed: Sequence[Placed], trial: CandidatePress
) -> tuple[Course, np.ndarray]:
    """Return the trial's course and its predicted readings, shape (rows, channels)."""
    own = laid_out(course, trial)
    return own, predict(own, elsewhere(response, course, own, trial), placed).signal


def elsewhere(response: Response, course: Course, own: Course, trial: CandidatePress) -> Response:
    """Return a response for another course, at a known place and tool."""
    if not isinstance(response, FittedResponse):
        return response
    alike = np.flatnonzero((course.row_site == trial.site) & (course.tool == trial.tool))
    return response.of_place(int(response.context[alike[0]]), own)
