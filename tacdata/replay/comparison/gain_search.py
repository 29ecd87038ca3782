"""Finds the smallest gain that holds an object in all preliminary trials, in simulation instead of on a robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from tacdata.errors import UsageError
from tacdata.replay.outcome import ReplayOutcome

PRELIMINARY = 1_000_000
"""First seed of the preliminary trials; trials that count have lower ones."""
STEPS = 12
"""Gains tried between zero and the largest before the interval is bisected [count]."""


@dataclass(frozen=True)
class GripDemand:
    """Criterion of every preliminary trial."""

    trials: int = 20
    """Scenes in which the gain is tried [count]."""
    slip: float = 0.003
    """Largest distance that the object may slide along a pad [m]."""
    force: float = 6.0
    """Largest mean force on a pad [N]; the skin of 3 N/mm is then pressed 2 mm deep."""
    grip: float = 2.0
    """Smallest grip factor [1]: the safety factor left for recordings whose depth is predicted too shallow."""


@dataclass(frozen=True)
class FoundGain:
    """The smallest gain, and the worst of the preliminary trials with it."""

    gain: float
    """Of every finger [m/mm]."""
    demand: GripDemand
    slip: float
    """Largest distance slid [m]."""
    force: float
    """Largest mean force on a pad [N]."""
    grip: float
    """Smallest grip factor [1]: friction that the pads can carry, over the load."""

    @property
    def document(self) -> dict[str, Any]:
        """The result as plain data."""
        return asdict(self)

    @property
    def text(self) -> str:
        """The result in a sentence."""
        return (
            f"{self.gain:.4f} m/mm for every finger held all {self.demand.trials} preliminary trials; at worst "
            f"friction can carry {self.grip:.1f} times the load, the object slides {1000 * self.slip:.1f} mm, and a "
            f"pad presses with {self.force:.1f} N"
        )


@dataclass
class GripSearch:
    """Tries gains in the scenes of the preliminary trials."""

    outcome: Callable[[float, int], ReplayOutcome]
    """Function from gain [m/mm] and seed to the outcome of one trial."""
    demand: GripDemand = field(default_factory=GripDemand)
    largest: float = 0.03
    """Largest gain tried [m/mm]."""
    tolerance: float = 2e-4
    """Width of the final interval [m/mm]."""

    def __post_init__(self) -> None:
        """Put the seeds in order."""
        self._seeds = [PRELIMINARY + k for k in range(self.demand.trials)]
        self._reasons: dict[float, str] = {}

    def find(self) -> FoundGain:
        """Return the smallest gain that meets the demand.

        Gains are tried upwards in equal steps, because a larger gain may also push an object away. The first interval
        that meets the demand is bisected.

        Raises:
            UsageError: If none does, with the failed criterion at the last gain.
        """
        low = 0.0
        for step in range(1, STEPS + 1):
            high = self.largest * step / STEPS
            if (best := self._tried(high)) is not None:
                break
            low = high
        else:
            raise UsageError(
                f"no gain up to {self.largest:g} m/mm holds all preliminary trials; with {low:.4f} m/mm: "
                + self._reasons[low],
                f"all {self.demand.trials} held, slip up to {1000 * self.demand.slip:g} mm, forces up to "
                f"{self.demand.force:g} N, friction for {self.demand.grip:g} times the load",
                "check the predicted depth (tacdata view), the object's mass and size, or ask for less with "
                "--most-slip, --most-force and --least-grip",
            )
        while high - low > self.tolerance:
            middle = (low + high) / 2
            candidate = self._tried(middle)
            if candidate is None:
                low = middle
            else:
                high, best = middle, candidate
        return best

    def _tried(self, gain: float) -> FoundGain | None:
        """Return a gain with its worst trials, or None as soon as one trial fails; that trial comes first next time."""
        slip, force, grip = 0.0, 0.0, float("inf")
        for seed in tuple(self._seeds):
            end = self.outcome(gain, seed)
            peak = max(end.force.values())
            demand = self.demand
            if not end.held or end.slip > demand.slip or peak > demand.force or end.grip < demand.grip:
                # A scene that defeats one gain is likely to defeat the next, so it comes first.
                self._seeds.remove(seed)
                self._seeds.insert(0, seed)
                self._reasons[gain] = f"{end.reason}, and a pad pressed with {peak:.1f} N"
                return None
            slip, force, grip = max(slip, end.slip), max(force, peak), min(grip, end.grip)
        return FoundGain(gain, self.demand, slip, force, grip)
