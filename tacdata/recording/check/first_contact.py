"""Depth of first contact in a press: 0 where registration, tool and machine's zero are right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import theilslopes

from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.idle import idle_rows
from tacdata.recording.onset import combined, onset

LIMITS = 0.15, 0.4
"""Depth of first contact from which a warning is given, and from which a session is unusable [mm].

The latter is a third of usual presses; hysteresis and adhesion of soft skins move first contact by up to 0.1 mm."""
SIGMA = 3.0
"""Standard uncertainties by which a first contact must exceed a limit [1]."""
LOW = 0.35
"""Share of a press's greatest answer up to which the curve is fitted [1]."""
FEW = 8
"""Readings that a fit needs, before contact and in all [count]."""
ABOVE = 12
"""Readings before contact that are fitted [count]."""
DRIFT_PRESSES = 12
"""Presses needed to judge a drift of first contact [count]."""
DRIFT_MM = 0.05
"""Warning threshold: drift of first contact over a session [mm]."""
CONFIDENCE = 0.99
"""Confidence level of a drift [1]."""


@dataclass(frozen=True)
class FirstContact:
    """First contact of one press."""

    depth: float
    """Depth at which the skin begins to answer [mm]; negative where it begins above depth zero."""
    uncertainty: float
    """Standard uncertainty [mm]."""

    def exceeds(self, limit: float) -> bool:
        """Whether it is farther than ``limit`` [mm] from depth zero."""
        return abs(self.depth) - SIGMA * self.uncertainty > limit


def first_contact(figures: RecordingFigures) -> FirstContact | None:
    """Return the first contact of a press; None where the readings do not show it.

    The mean of going in and coming out, in which a delay of the readings cancels.
    """
    episode = figures.recording.episode
    idle = idle_rows(episode)
    if idle.sum() < FEW or len(episode.tip_ns) < 2 or not np.isfinite(episode.taxels.counts).all():
        return None
    depth = episode.tip_at(episode.taxels.sample_ns)[:, 2]
    noise = np.maximum(episode.taxels.counts[idle].std(axis=0, ddof=1), 0.3)
    inside = np.flatnonzero(depth > depth.max() - 1e-3)
    if not len(inside):
        return None
    counts = episode.taxels.counts
    # In and out: a delay between the streams shifts one of them deeper and the other shallower, so their mean is free
    # of it.
    ways = [
        _one_way(depth[: inside[0] + 1], counts[: inside[0] + 1], noise),
        _one_way(depth[inside[-1] :][::-1], counts[inside[-1] :][::-1], noise),
    ]
    contacts = [way for way in ways if way is not None]
    if not contacts:
        return None
    spread = abs(contacts[0].depth - contacts[-1].depth) / np.sqrt(12)  # the two bracket it
    sigma = float(np.hypot(np.mean([c.uncertainty for c in contacts]), spread))
    return FirstContact(float(np.mean([c.depth for c in contacts])), sigma)


def _one_way(depth: np.ndarray, counts: np.ndarray, noise: np.ndarray) -> FirstContact | None:
    """Fit first contact to readings in the order of growing depth."""
    # Where the tip rests, the skin relaxes: such readings are no function of depth.
    moving = np.concatenate([np.diff(depth) > 1e-4, [True]])
    depth, counts = depth[moving], counts[moving]
    if len(depth) < FEW:
        return None
    answer = combined(counts, noise)
    beyond = np.flatnonzero(answer > LOW * answer[-3:].mean())
    last = max(int(beyond[0]) + 1 if len(beyond) else len(answer), FEW)
    # Three standard deviations of the noise of rest.
    begin = np.flatnonzero(answer[:last] < 3.0)
    first = max(int(begin[-1]) - ABOVE, 0) if len(begin) else 0
    fitted = onset(-depth[first:last], answer[first:last])
    if fitted is None:
        return None
    return FirstContact(-fitted.height, float(np.hypot(fitted.uncertainty, fitted.model)))


def height_words(contacts: list[FirstContact]) -> tuple[float, str] | None:
    """Return the middle depth of first contact and its words, if it is beyond the first limit; else None."""
    if not contacts:
        return None
    depth = float(np.median([contact.depth for contact in contacts]))
    sigma = float(np.median([contact.uncertainty for contact in contacts])) / np.sqrt(len(contacts))
    if not FirstContact(depth, sigma).exceeds(LIMITS[0]):
        return None
    effect = "presses go deeper" if depth < 0 else "presses are shallower"
    return depth, (
        f"first contact is at depth {depth:+.2f} mm, not at 0 (median of {len(contacts)} presses): {effect} than "
        "stated; the registration's height, the tool or the machine's zero is wrong"
    )


def drift_words(contacts: list[tuple[int, FirstContact]]) -> str:
    """Return a drift of first contact over the numbers of the presses, in words; empty without one."""
    if len(contacts) < DRIFT_PRESSES:
        return ""
    number = np.array([k for k, _ in contacts], float)
    depth = np.array([contact.depth for _, contact in contacts])
    # The median of all pairs' slopes: single wrong contacts do not turn it.
    slope, intercept, low, high = theilslopes(depth, number, CONFIDENCE)
    total = slope * np.ptp(number)
    # A tool that slipped once is a step, and is reported as such: its line through all presses is no drift.
    is_step = _step_error(depth) < np.abs(depth - intercept - slope * number).sum()
    if low * high <= 0 or abs(total) < DRIFT_MM or is_step:
        return ""
    return (
        f"first contact drifts by {1000 * slope:+.1f} um a press, {total:+.2f} mm over {len(contacts)} presses: the "
        "machine loses steps, or the skin or the tool creeps"
    )


def _step_error(depth: np.ndarray) -> float:
    """Return the smallest sum of absolute deviations from one median before a step and one after it [mm]."""
    cuts = range(2, len(depth) - 1)
    return min(sum(np.abs(part - np.median(part)).sum() for part in np.split(depth, [cut])) for cut in cuts)
