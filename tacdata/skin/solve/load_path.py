"""One press on its way through its depths: which to try next, and when to give up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from tacdata.errors import SolveError
from tacdata.skin.solve.settings import SolverSettings

_LEAST_STEP = 0.01
"""Load step below which a press is given up [mm]."""

_SHALLOW = 0.1
"""Least depth in the relative limit of penetration [mm]."""


@dataclass
class LoadPath:
    """The depths of one press, reached in bounded steps that are halved where no equilibrium is found."""

    depths: tuple[float, ...]
    """Depths of the states wanted [mm]."""
    longest: float
    """Longest step down [mm]."""
    where: str
    """The press in words, for errors."""
    first: float = math.inf
    """Longest step from the first touch [mm]; an edge must not be pressed in by much of its own radius at once."""
    lift: float = math.inf
    """Longest step upward [mm]; a skin that sticks must not be torn off by a long one."""
    depth: float = 0.0
    """Of the last equilibrium [mm]."""
    attempt: float = 0.0
    """The depth being tried [mm]."""
    direction: float = 0.0
    """Of the last step [mm]."""
    newton: int = 0
    """Newton steps of the present attempt."""
    spent: int = 0
    """Newton steps since the last wanted state, failed attempts included."""
    changed: int = 0
    """Those of them after which contact had another status: a node opened, closed, stuck or slipped."""
    _wanted: int = 0
    _step: float = 0.0
    _best: float = math.inf
    _best_at: int = 0
    reason: str = field(default="no attempt", repr=False)
    """Why the last attempt failed."""

    def __post_init__(self) -> None:
        """Propose the first attempt."""
        self._step = min(self.first, self.longest)
        self._propose()

    def _propose(self) -> None:
        way = self.depths[self._wanted] - self.depth
        step = min(max(way, -min(self._step, self.lift)), min(self._step, self.longest))
        # The wanted depth itself, not a sum: `found` compares depths to 1e-12 mm.
        self.attempt = self.depths[self._wanted] if step == way else self.depth + step
        self.newton, self._best, self._best_at = 0, math.inf, 0

    def judge(self, error: float, penetration: float, mean: float, volume: float, settings: SolverSettings) -> str:
        """Return the verdict on the present iterate: "found", "failed" or "go on".

        Args:
            error: Out-of-balance force over the contact force [1].
            penetration: Largest [mm].
            mean: Mean, weighted by the load [mm].
            volume: Smallest det F [1].
            settings: The limits.
        """
        deep = max(self.attempt, _SHALLOW)
        # The largest excess over its limit measures the distance from the solution, from the first step on.
        shares = (
            error / settings.residual,
            penetration / (settings.penetration * deep),
            mean / (settings.mean_penetration * deep),
        )
        excess = max(shares) if all(map(math.isfinite, shares)) else math.inf
        if excess <= 1:
            return "found"
        stuck = not excess < 0.9 * self._best and self.newton - self._best_at > settings.patience
        if stuck or not math.isfinite(error) or self.newton >= settings.newton_limit:
            self.reason = (
                f"after {self.newton} Newton iterations the residual is {error:.1e} of the contact force (allowed "
                f"{settings.residual:.0e}), penetration {1e3 * penetration:.1f} um, smallest det F {volume:.2f}"
            )
            return "failed"
        if self.newton and excess < 0.9 * self._best:
            self._best, self._best_at = excess, self.newton
        return "go on"

    def stepped(self) -> None:
        """Count a Newton step."""
        self.newton += 1
        self.spent += 1

    def status_changed(self) -> None:
        """Count the last Newton step, if one was taken, as one after which contact had another status."""
        self.changed += self.newton > 0

    def taken(self) -> int:
        """Return the Newton steps since the last requested state, and reset the count."""
        spent, self.spent, self.changed = self.spent, 0, 0
        return spent

    def passed_through(self) -> None:
        """Say why the present iterate, balanced as it is, is no state of this press."""
        self.reason = f"at {self.attempt:.3f} mm the skin has passed through the indenter and lies above it"

    def found(self) -> bool:
        """Take the attempt as the present state; return whether it is one that is wanted."""
        if self.attempt != self.depth:
            self.direction = self.attempt - self.depth
        self.depth = self.attempt
        reached = abs(self.depths[self._wanted] - self.depth) <= 1e-12
        if reached:
            self._wanted += 1
            # `_propose` limits each direction by its own bound.
            self._step = max(self.longest, self.lift)
        else:
            # After a step that had to be halved, back to longer ones by doubling.
            self._step = min(2 * self._step, max(self.longest, self.lift))
        return reached

    @property
    def finished(self) -> bool:
        """Whether all wanted states are found."""
        return self._wanted == len(self.depths)

    def go_on(self) -> None:
        """Propose the next attempt."""
        self._propose()

    def halve(self) -> None:
        """Propose a smaller step.

        Raises:
            SolveError: If it would be too small.
        """
        self._step = abs(self.attempt - self.depth) / 2
        if self._step < _LEAST_STEP:
            raise SolveError(
                f"{self.where}: no equilibrium beyond depth {self.depth:.3f} mm; {self.reason}",
                "a residual and penetration within the solver settings",
                "reduce the depth, use a finer mesh, or a blunter indenter",
            )
        self._propose()
