"""Spectrum: linear memory of load by any positive mixture of times. The laws of a mechanism are points in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import low_passes
from tacdata.effects import Effect, Family, Parameter, Placed

TIMES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Time constants [s]: presses tell no finer steps, and presses last for as long."""
FIRST_SHARE = 0.03
"""Share of each time with which a fit begins [1]: none is at its bound."""


class Spectrum(Effect):
    """Stress relaxation by any mixture of times."""

    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - sum of f_k L_k q_e, f_k >= 0, the times growing with a power of the tool's radius"
    source = "Prony series with positive weights; Ferry, ch. 3"
    experiment = "two indenters at the same depth over radius"
    parameters = tuple(
        Parameter(f"f{k}", "1", f"share that relaxes by {time:g} s", 0.1, 0.0, 0.95) for k, time in enumerate(TIMES)
    )

    def __init__(self, by_radius: float, by_depth: bool) -> None:
        """Take the variables that the times and the shares depend on.

        Args:
            by_radius: Power of the tool's radius by which times grow [1].
            by_depth: Whether shares grow with depth.
        """
        self.by_radius, self.by_depth = by_radius, by_depth

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        loads = np.column_stack([state.load, state.force])
        base = loads * np.maximum(state.depth, 0.0)[:, None] / course.span if self.by_depth else loads
        shares = np.array([float(values[p.name]) for p in self.parameters])
        for radius, rows in _tools(course.tool, [tool.radius for tool in course.tools], self.by_radius):
            excerpt = np.where(rows[:, None], base, 0.0)
            loads = loads - low_passes(excerpt, course.step, np.array(TIMES) * radius, shares)
        return replace(state, load=loads[:, :-1], force=loads[:, -1])


def spectrum(law: Effect, by_radius: float) -> Placed:
    """Return the spectrum that holds a law, its times growing with a power of the radius, ready for a fit."""
    effect = Spectrum(by_radius, law.memory_by_depth)
    return Placed(effect, {p.name: np.array(FIRST_SHARE) for p in effect.parameters})


def _tools(tool: np.ndarray, radii: list[float], power: float) -> list[tuple[float, np.ndarray]]:
    """Return by how much the times of each tool are longer [1], and its rows; all at once where they are not."""
    if not power:
        return [(1.0, np.ones(len(tool), dtype=bool))]
    sizes = np.where(np.isfinite(radii), radii, np.nanmedian(radii))
    return [(float(r), tool == k) for k, r in enumerate((sizes / np.median(sizes)) ** power)]
