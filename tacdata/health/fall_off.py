"""How responses fall off with the distance from the tip: the effect of a displaced tip, level by level."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.health.response import LEVELS, PressResponse

DEGREE = 2
"""Degree, in the squared distance, of the logarithm of a response."""
HELD = 2.0
"""How strongly a channel's own gain is held to 1 in the fit [1]: spread of the fit over that of gains."""
STEEPEST = 1.0
"""Largest logarithm of a response's ratio under a shift [1]; beyond it the polynomial is not to be trusted."""


@dataclass(frozen=True)
class FallOff:
    """A polynomial of the squared distance for each level."""

    unit: float
    """Squared distance that counts as 1 [mm^2]."""
    terms: np.ndarray
    """Coefficients of its powers from the first on [1], shape (levels, `DEGREE`)."""

    def shifted(self, away: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the effect of a shift of the tip on responses, and its derivative by the shift.

        Args:
            away: Taxels less the tip's place [mm], shape (taxels, 2).
            shift: Displacement of the tip [mm], shape (2,).

        Returns:
            Factor of each response [1], shape (levels, taxels); its derivatives over itself [1/mm], shape (levels,
            taxels, 2).
        """
        powers, relative = np.arange(1, DEGREE + 1), away - shift
        initial, final = ((np.square(a).sum(axis=1) / self.unit)[:, None] for a in (away, relative))
        grown = (final**powers - initial**powers) @ self.terms.T
        steep = -2 / self.unit * (final ** (powers - 1)) @ (powers * self.terms).T
        return np.exp(np.clip(grown, -STEEPEST, STEEPEST)).T, steep.T[:, :, None] * relative


def fall_off(presses: Sequence[PressResponse], near: Sequence[Sequence[int]], centers: np.ndarray) -> FallOff:
    """Fit the logarithms of responses: strength of each press, gain of each channel, a polynomial that all share.

    Args:
        presses: Responses of the channels.
        near: Channels that each press excites.
        centers: Places of the taxels [mm], shape (taxels, 2).
    """
    powers, taxels = np.arange(1, DEGREE + 1), len(centers)
    squared = [np.square(centers - (p.press.x, p.press.y)).sum(axis=1) for p in presses]
    unit = max(
        float(np.mean(np.concatenate([s[list(channels)] for s, channels in zip(squared, near, strict=True)]))), 1e-9
    )
    # Strengths of presses and gains are known up to a common factor only; this keeps gains near 1.
    prior = np.hstack([np.zeros((taxels, DEGREE + len(presses))), HELD * np.eye(taxels)])
    terms = []
    for level in range(len(LEVELS) + 1):
        rows, heights = [prior], [0.0] * taxels
        for k, (press, channels, distances) in enumerate(zip(presses, near, squared, strict=True)):
            # A logarithm needs the sign of the hold, which noise may turn in a faint response.
            use = [c for c in channels if press.levels[level, c] * press.hold[c] > 0]
            row = np.zeros((len(use), prior.shape[1]))
            row[:, :DEGREE] = (distances[use, None] / unit) ** powers
            row[:, DEGREE + k] = 1.0
            row[np.arange(len(use)), DEGREE + len(presses) + np.array(use, int)] = 1.0
            rows.append(row)
            heights += np.log(np.abs(press.levels[level, use])).tolist()
        terms.append(np.linalg.lstsq(np.vstack(rows), np.array(heights), rcond=None)[0][:DEGREE])
    return FallOff(unit, np.array(terms))
