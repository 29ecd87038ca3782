"""Wilson's score interval for a proportion."""

from __future__ import annotations

from math import sqrt

from tacdata.errors import UsageError

Z95 = 1.959963984540054
"""Standard normal quantile at 0.975 [1]."""


def interval(successes: int, trials: int, z: float = Z95) -> tuple[float, float]:
    """Return the lower and upper bound of the proportion (Wilson, J. Am. Stat. Assoc. 22, 1927, p. 209).

    Args:
        successes: Trials that succeeded.
        trials: All trials, at least one.
        z: Standard normal quantile; the default gives 95 %.

    Raises:
        UsageError: If the counts make no proportion.
    """
    if not 0 <= successes <= trials or trials < 1:
        raise UsageError(
            f"{successes} successes in {trials} trials",
            "0 <= successes <= trials, trials >= 1",
            "count again",
        )
    p, z2 = successes / trials, z * z / trials
    centre = (p + z2 / 2) / (1 + z2)
    half = z / (1 + z2) * sqrt(p * (1 - p) / trials + z2 / (4 * trials))
    # At the ends the bound is 0 or 1 exactly; rounding must not carry it outside.
    return (0.0 if successes == 0 else centre - half), (1.0 if successes == trials else centre + half)
