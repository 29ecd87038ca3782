"""Finite linear viscoelasticity: the isochoric stress relaxes by a Prony series, the volumetric one does not.

Simo's split in the form of Holzapfel (2000), Nonlinear Solid Mechanics, section 6.10: with S the long-term isochoric
second Piola-Kirchhoff stress of the law, P = P_vol + P_iso + F sum_i Q_i and

    dQ_i/dt + Q_i / tau_i = beta_i dS/dt,   beta_i = g_i / (1 - sum g),

so that G(t) = G_inf (1 + sum_i beta_i exp(-t/tau_i)) = G0 (1 - sum_i g_i (1 - exp(-t/tau_i))). Young's modulus of the
sensor file belongs to G_inf: a slow press is that of the elastic law, a sudden one is stiffer by 1 / (1 - sum g).

A step is integrated exactly for S linear in time within it, which is second-order accurate in its duration dt and
right for dt -> 0 and dt -> infinity:

    Q_i(t + dt) = e_i Q_i(t) + r_i (S(t + dt) - S(t)),   e_i = exp(-dt/tau_i),  r_i = beta_i tau_i/dt (1 - e_i),

so that P = P_vol + a P_iso + F S_h with a = 1 + sum r_i and S_h = sum_i (e_i Q_i(t) - r_i S(t)) known before the
step is solved. The tangent is that of the law with a, plus dF S_h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tacdata.sensor import Material

Array = Any
"""A numpy array or a torch tensor; what is done with them here is the same for both."""


@dataclass(frozen=True)
class PronyStep:
    """Coefficients of one time step."""

    amplification: float
    """a [1]: factor on the law's isochoric stress, 1 for a slow step, G0/G_inf for a sudden one."""
    decay: tuple[float, ...]
    """e_i [1], one a term: what is left of each branch stress after the step."""
    gain: tuple[float, ...]
    """r_i [1], one a term: how much of the change of S goes into each branch stress."""


@dataclass(frozen=True)
class PronyHistory:
    """State of the material points between steps; any trailing shape, so tensors of (points, 3, 3) or (points, 6)."""

    branches: tuple[Array, ...]
    """Branch stresses Q_i [MPa], one a term, each of the shape of ``stress``."""
    stress: Array
    """Long-term isochoric second Piola-Kirchhoff stress S at the last step [MPa]."""


@dataclass(frozen=True)
class Prony:
    """A Prony series of the shear modulus."""

    shares: tuple[float, ...]
    """g_i [1], shares of the instantaneous modulus, with a sum below 1."""
    times: tuple[float, ...]
    """tau_i [s], all different."""

    @classmethod
    def of(cls, material: Material) -> Prony:
        """Return the series of a sensor's material; without terms where it does not relax."""
        return cls(tuple(t.share for t in material.prony), tuple(t.time for t in material.prony))

    @property
    def instantaneous_ratio(self) -> float:
        """G0 / G_inf [1]."""
        return 1 / (1 - sum(self.shares))

    @property
    def strengths(self) -> tuple[float, ...]:
        """beta_i = g_i G0 / G_inf [1], one a term."""
        return tuple(g * self.instantaneous_ratio for g in self.shares)

    def relaxation(self, time: np.ndarray) -> np.ndarray:
        """Return G(t) / G_inf [1] at times after a sudden strain [s]."""
        t = np.asarray(time, dtype=float)[..., None]
        return 1 + np.sum(np.array(self.strengths) * np.exp(-t / np.array(self.times)), axis=-1)

    def step(self, duration: float) -> PronyStep:
        """Return the coefficients of a step of a duration [s]; 0 for a sudden one, ``inf`` for full relaxation.

        Raises:
            ValueError: If the duration is negative or no number.
        """
        if not duration >= 0:
            raise ValueError(f"time step {duration} s, allowed are 0 s or more")
        x = [duration / tau for tau in self.times]
        gain = tuple(b * _mean_decay(y) for b, y in zip(self.strengths, x, strict=True))
        return PronyStep(1 + sum(gain), tuple(float(np.exp(-y)) for y in x), gain)

    def start(self, stress: Array) -> PronyHistory:
        """Return the history of points that have rested at a stress S [MPa] (zeros: undeformed) for long."""
        return PronyHistory(tuple(stress * 0.0 for _ in self.times), stress)

    def stored_stress(self, step: PronyStep, history: PronyHistory) -> Array:
        """Return S_h [MPa], of the shape of S: what the past adds to the second Piola-Kirchhoff stress."""
        total = history.stress * 0.0
        for decay, gain, branch in zip(step.decay, step.gain, history.branches, strict=True):
            total = total + (decay * branch - gain * history.stress)
        return total

    def advance(self, step: PronyStep, history: PronyHistory, stress: Array) -> PronyHistory:
        """Return the history after a step that ended at the long-term isochoric stress S [MPa]."""
        change = stress - history.stress
        parts = zip(step.decay, step.gain, history.branches, strict=True)
        return PronyHistory(tuple(decay * branch + gain * change for decay, gain, branch in parts), stress)

    def dissipation(self, history: PronyHistory, shear_modulus: float) -> Array:
        """Return the rate of dissipated energy per volume at small strain [MPa/s], never negative.

        sum_i Q_i : Q_i / (2 beta_i mu tau_i) over the last two axes, for histories of full 3 x 3 tensors.
        """
        total = (history.stress * 0.0).sum(-1).sum(-1)
        for strength, tau, branch in zip(self.strengths, self.times, history.branches, strict=True):
            total = total + (branch * branch).sum(-1).sum(-1) / (2 * strength * shear_modulus * tau)
        return total


def _mean_decay(x: float) -> float:
    """Return (1 - exp(-x)) / x, 1 at x = 0 and 0 at infinity."""
    if x == 0:
        return 1.0
    return float(-np.expm1(-x) / x) if np.isfinite(x) else 0.0
