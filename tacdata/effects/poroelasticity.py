"""Fluid moves through the skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import Effect, Parameter


class Poroelasticity(Effect):
    """Fluid moves through the skin."""

    title = "Fluid moves through the skin"
    catalogue = ("M14",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    equation = "q = q_e - f L_tau q_e, tau = R d / D_eff: proportional to the contact radius squared"
    source = "Hu et al., Appl. Phys. Lett. 96 (2010) 121904"
    experiment = (
        "two indenters at the same depth over radius: the time grows with the contact radius squared, that of "
        "relaxation does not"
    )
    memory_error = 0.3
    parameters = (
        Parameter("f", "1", "relaxed share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time at the median radius", 10.0, 0.5, 500.0, grid=(1.0, 4.0, 16.0, 60.0)),
    )

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        radii = np.array([tool.radius for tool in course.tools], dtype=float)
        radii = np.where(np.isfinite(radii), radii, np.nanmedian(radii))
        both = np.column_stack([state.load, state.force])
        slow = np.zeros_like(both)
        for t, radius in enumerate(radii):
            rows = course.tool == t
            tau = float(values["tau"]) * radius / np.median(radii)
            slow[rows] = low_pass(np.where(rows[:, None], both, 0.0), course.step, tau)[rows]
        both = both - values["f"] * slow
        return replace(state, load=both[:, :-1], force=both[:, -1])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot tell of it; empty if they may."""
        radii = {tool.radius for tool in course.tools if np.isfinite(tool.radius)}
        return "one radius of indenter: it cannot be told from relaxation" if len(radii) < 2 else ""
