"""Fluid moves through the skin."""

import numpy as np
from scipy.special import erfcinv

from tacdata.chain.memory import low_passes
from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values

ROOTS = 6
"""Number of first-order means that approximate the root."""
_LEVY = 0.25 / np.square(erfcinv((np.arange(ROOTS) + 0.5) / ROOTS))
SPECTRUM = (*((0.908**2 * float(rate), 0.491 / ROOTS) for rate in _LEVY), (1.679, 0.509))
"""Rates over 1 / tau, and shares [1]: exp(-c sqrt(t)) is a mixture of exp(-c^2 u t), u following a Levy distribution,
of density u^-1.5 exp(-1 / (4 u)) / (2 sqrt(pi))."""


class Poroelasticity(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = (
        "q = q_e - f (q_e - g * q_e'), g(t) = 0.491 exp(-0.908 sqrt(t / tau)) + 0.509 exp(-1.679 t / tau), "
        "tau = R d / D_eff: proportional to the contact radius squared"
    )
    source = "Hu et al., Appl. Phys. Lett. 96 (2010) 121904, for a sphere; the root as a mixture of exponentials"
    experiment = (
        "two indenters at the same depth over radius: the time grows with the contact radius squared, that of "
        "relaxation does not"
    )
    odds = 0.04  # silicone is a dry rubber, which relaxes; fluid moves in gels, foams and wet covers
    times_by_radius = 1.0
    parameters = (
        Parameter("f", "1", "relaxed share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time at the median radius", 10.0, 0.5, 500.0, grid=(1.0, 4.0, 16.0, 60.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        radii = np.array([tool.radius for tool in course.tools], dtype=float)
        # A tool without a radius takes the time of a usual one.
        radii = np.where(np.isfinite(radii), radii, np.nanmedian(radii))
        loads = state.loads
        slow = np.zeros_like(loads)
        rates, shares = np.array(SPECTRUM).T
        for t, radius in enumerate(radii):
            rows = course.tool == t
            tau = float(values["tau"]) * radius / np.median(radii)
            pressed = np.where(rows[:, None], loads, 0.0)
            # The fluid that one tool has displaced returns also while another tool presses.
            slow += low_passes(pressed, course.step, tau / rates, shares)
        loads = loads - values["f"] * slow
        return state.with_loads(loads)

    def unjudgeable(self, course: Course, response: Response) -> str:
        radii = {tool.radius for tool in course.tools if np.isfinite(tool.radius)}
        return "one radius of indenter: it cannot be distinguished from relaxation" if len(radii) < 2 else ""
