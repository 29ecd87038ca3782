"""Depth zero of every session is off by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter

LEAST = 4
"""Fewer sessions have no more freedom than a shift from one to the next."""


class SessionLevels(Effect):
    """Depth zero of every session is off by itself."""

    title = "Depth zero of every session is off by itself"
    catalogue = ("K18", "E5")
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + sum of dz_k cos(pi k (session + 1/2) / sessions), k of 1 to 3"
    source = "discrete cosine transform: any levels of four sessions; Ahmed et al., IEEE Trans. Comput. C-23 (1974) 90"
    experiment = "home and touch off several times"
    form_error = 0.02
    mechanism = "session_zero"
    parameters = tuple(Parameter(f"dz{k}", "mm", f"size of pattern {k}", 0.05, -1.0, 1.0) for k in (1, 2, 3))

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        session = state.course.session
        turn = np.pi * (session[state.course.episode] + 0.5) / (int(session.max()) + 1)
        shift = sum(values[p.name] * np.cos(k * turn) for k, p in enumerate(self.parameters, 1))
        return replace(state, pose=state.pose + np.array([0.0, 0.0, 1.0]) * np.asarray(shift)[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        few = int(course.session.max()) + 1
        return f"{few} sessions: a shift from one to the next tells as much" if few < LEAST else ""
