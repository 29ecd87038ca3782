"""Responses of the channels to one press: at shares of its depth on the way in, and at the end of the hold."""

from dataclasses import dataclass

import numpy as np

from tacdata import provenance
from tacdata.plans import Press
from tacdata.recording.check.figures import RecordingFigures, hold_response, idle_reading
from tacdata.recording.episode import PHASES, Episode

LEVELS = (0.4, 0.7, 1.0)
"""Shares of the press's depth at which the way in is read [1]; the hold is one more level."""
LOWEST = 0.3
"""Share of the depth from which the way in is fitted [1]: below it contact may not have begun."""
DEGREE = 3
"""Degree of the polynomial of depth that smooths the way in."""
FEWEST = 8
"""Readings on the way in, at least [frames]."""
LOOP_POINTS = 40
"""Depths at which the two ways are compared [count]."""
SHALLOWEST = 0.15
"""Depth from which a press is used [mm]."""


@dataclass(frozen=True)
class PressResponse:
    """Responses to one press, above the reading at rest."""

    press: Press
    file: str
    """Name of the recording."""
    start_ns: int
    """Time of its first reading [ns]."""
    levels: np.ndarray
    """Responses at `LEVELS` and in the hold [counts], shape (levels + 1, taxels)."""
    slope: np.ndarray
    """Derivatives of these by depth [counts/mm], same shape."""
    spread: np.ndarray
    """Variances of these in units of one reading's [1], shape (levels + 1,)."""
    loop: float
    """Area between the way in and the way out, over depth times greatest response, all channels together [1]."""

    @property
    def hold(self) -> np.ndarray:
        """Change from rest to hold [counts], shape (taxels,)."""
        return self.levels[-1]

    @property
    def key(self) -> tuple[str, float, float, float, float]:
        """Indenter with angles and turns, place [mm], depth [mm], speed [mm/s]: presses that share it compare."""
        p = self.press
        turns = [p.overshoot, p.strokes, p.stroke]
        shape = provenance.content_hash({"shape": p.indenter.document, "angles": p.angles, "turns": turns})
        return shape, round(p.x, 2), round(p.y, 2), round(p.depth, 2), round(p.speed, 3)


def unusable(figures: RecordingFigures) -> str:
    """Return why a recording carries no information on the unit, as a sentence; "" if it does."""
    episode = figures.recording.episode
    if not episode.complete:
        return "it was interrupted"
    if episode.press.depth < SHALLOWEST:
        return f"depth {episode.press.depth:g} mm presses nothing"
    if not np.isfinite(hold_response(episode)).any():
        return "no readings in both rest and hold"
    way = episode.phase_at(episode.taxels.sample_ns) == PHASES.index("press")
    if way.sum() < FEWEST:
        return f"{way.sum()} readings on the way in, at least {FEWEST} are needed"
    return ""


def press_response(episode: Episode, counts: np.ndarray | None = None) -> PressResponse:
    """Return the responses to a press.

    Args:
        episode: A recording that `unusable` has no words for.
        counts: Readings in place of its own, such as a label's predicted ones [counts], shape (n, taxels).
    """
    measured = episode.taxels.counts
    counts = measured if counts is None else counts
    phase, depth = episode.phase_at(episode.taxels.sample_ns), episode.tip_at(episode.taxels.sample_ns)[:, 2]
    idle, plateau = phase == PHASES.index("rest"), phase == PHASES.index("hold")
    above = np.nan_to_num(counts - (idle_reading(episode) if counts is measured else np.median(counts[idle], axis=0)))
    share = depth / episode.press.deepest
    way = (phase == PHASES.index("press")) & (share > LOWEST)
    powers = np.arange(DEGREE + 1)
    inverse = np.linalg.pinv(share[way, None] ** powers)
    fitted = inverse @ above[way]
    at = np.array(LEVELS)[:, None] ** powers
    rising = powers[1:] * np.array(LEVELS)[:, None] ** powers[:-1]
    hold = np.median(above[plateau], axis=0)
    levels, slope = at @ fitted, rising @ fitted[1:] / episode.press.deepest
    # The variance of a median is pi / 2 times that of a mean.
    spread = np.concatenate([((at @ inverse) ** 2).sum(axis=1), [np.pi / 2 / plateau.sum()]])
    return PressResponse(
        episode.press,
        episode.path.name,
        int(episode.taxels.sample_ns[0]),
        np.vstack([levels, hold]),
        np.vstack([slope, slope[-1]]),
        spread,
        _loop(above.sum(axis=1), share, phase),
    )


def _loop(strength: np.ndarray, share: np.ndarray, phase: np.ndarray) -> float:
    """Return the loop's area [1]; NaN if it was not pressed or not released."""
    at, ways = np.linspace(LOWEST, 1.0, LOOP_POINTS), []
    for name in ("press", "release"):
        rows = np.flatnonzero((phase == PHASES.index(name)) & (share > 0))
        if len(rows) < FEWEST:
            return float("nan")
        order = rows[np.argsort(share[rows], kind="stable")]
        ways.append(np.interp(at, share[order], strength[order]))
    greatest = float(np.abs(strength[phase == PHASES.index("hold")]).max(initial=0.0))
    return float(np.trapezoid(ways[0] - ways[1], at)) / greatest if greatest > 0 else float("nan")
