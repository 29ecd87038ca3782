"""Two arms in the same scenes: their difference, with an interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import binomtest


@dataclass(frozen=True)
class PairedDifference:
    """Share held by one arm less that of another, over the same scenes."""

    first: int
    """Scenes that only the first arm held [count]."""
    second: int
    """Scenes that only the other held [count]."""
    of: int
    """All scenes [count]."""

    @property
    def value(self) -> float:
        """Difference of the shares [1]."""
        return (self.first - self.second) / self.of

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the difference, 95 % [1]: Wilson's for the share of the first among the scenes that differ."""
        differing = self.first + self.second
        if not differing:
            reach = min(3.0 / self.of, 1.0)  # the rule of three: none of n differed
            return -reach, reach
        low, high = binomtest(self.first, differing).proportion_ci(method="wilson")
        return (2 * low - 1) * differing / self.of, (2 * high - 1) * differing / self.of

    @property
    def text(self) -> str:
        """The difference in words."""
        low, high = self.interval
        return f"{self.value:+.0%} ({low:+.0%} to {high:+.0%})"


def paired(first: Sequence[bool], second: Sequence[bool]) -> PairedDifference:
    """Return the difference of two arms, from their outcomes in the same scenes, in the same order."""
    pairs = list(zip(first, second, strict=True))
    return PairedDifference(sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs), len(pairs))


def worth(outcomes: Sequence[bool], controls: dict[str, list[bool]], what: str = "depth") -> str:
    """Return the benefit of an arm over the best of the others, as a sentence.

    Args:
        outcomes: Outcomes of that arm (held or not), scene by scene.
        controls: Arm -> its outcomes in the same scenes.
        what: Noun for the difference between that arm and the others.
    """
    if not controls:
        return f"what {what} was worth is not known: there is no other arm"
    best = max(controls, key=lambda name: sum(controls[name]))
    difference = paired(outcomes, controls[best])
    low, high = difference.interval
    measured = f"{what} against {best}: {difference.text}, paired over {difference.of} scenes"
    if low > 0:
        return f"{measured}: {what} was worth that much"
    if high < 0:
        return f"{measured}: {what} did worse than moving without it"
    return f"{measured}: {what} was worth nothing that these scenes show"
