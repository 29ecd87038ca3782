"""Errors of a network's depth maps at a visit, press by press, and by how much they have grown."""

from dataclasses import dataclass

import numpy as np

from tacdata.health.estimate import UncertainValue, mean


@dataclass(frozen=True)
class NetworkError:
    """Errors of one network at one visit, against the labels."""

    checkpoint: str
    """Hash of the network's file."""
    presses: dict[int, float]
    """Number of a press -> root mean square error in the contact region [mm]."""

    @property
    def mean(self) -> UncertainValue:
        """Mean over the presses [mm]."""
        return mean(np.array(list(self.presses.values()), float))


def growth(later: NetworkError, earlier: NetworkError, pairs: list[tuple[int, int]]) -> UncertainValue | None:
    """Return the logarithm of the ratio of both errors, paired by press; None with fewer than two pairs.

    Args:
        later: At the later visit.
        earlier: At the earlier one.
        pairs: Numbers of the same press, now and before.
    """
    ratios = [
        np.log(later.presses[a] / earlier.presses[b])
        for a, b in pairs
        if later.presses.get(a, 0.0) > 0 and earlier.presses.get(b, 0.0) > 0
    ]
    return mean(np.array(ratios)) if len(ratios) > 1 else None
