"""Do readings, motion and label belong together: in time, in place, and to the end?"""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.channel_order import Answers
from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.idle import idle_rows

CONTACT = 0.3
"""Depth from which a press is used [mm]."""
CLEAR = 20.0
"""Answer from which its time can be told [times the noise]."""
FEW = 10
"""Readings without contact that are needed [count]."""
INSIDE = 0.5
"""Distance of a press from the outermost taxels' centres, inwards, from which its centre of answer is used [mm]."""
FEWEST = 4
"""Presses on both sides of a slip, at least [count]."""
SLIP = (0.7, 7.0)
"""Slip that is reported: at least so far [mm], and so many times its own standard error [1]."""


def reading_lag(figures: RecordingFigures) -> float | None:
    """Return how much later the readings come than the motion [ms]; None where it cannot be told.

    Taken where answer and depth cross half of their greatest value, going in and coming out. A curved answer moves
    both crossings in opposite ways, so the mean is the delay. What remains is the skin's own: its creep and hysteresis.
    """
    episode = figures.recording.episode
    time_ns, idle = episode.taxels.sample_ns, idle_rows(episode)
    if idle.sum() < FEW or not len(episode.tip_ns) or episode.press.depth < CONTACT:
        return None
    change = episode.taxels.counts - np.median(episode.taxels.counts[idle], axis=0)
    if not np.isfinite(change).all():
        return None
    noise = np.maximum(change[idle].std(axis=0), 0.5)
    # The middle of the ten greatest: one spike is no answer.
    greatest = np.sort(np.abs(change), axis=0)[-FEW:].mean(axis=0)
    channel = int(np.argmax(greatest / noise))
    if greatest[channel] < CLEAR * noise[channel]:
        return None
    depth = np.maximum(episode.tip_at(time_ns)[:, 2], 0.0)
    felt = _crossings(np.abs(change[:, channel]), float(greatest[channel]), time_ns)
    gone = _crossings(depth, float(depth.max()), time_ns)
    if felt is None or gone is None:
        return None
    return float(np.mean(felt - gone) / 1e6)


def loading(figures: RecordingFigures) -> float:
    """Return how long the way in takes [ms]: a skin with hysteresis leads or lags by a share of it."""
    press = figures.recording.episode.press
    return 1e3 * press.deepest / press.speed


def _crossings(values: np.ndarray, greatest: float, time_ns: np.ndarray) -> np.ndarray | None:
    """Return when half of the greatest value is first passed upwards and last passed downwards [ns], shape (2,)."""
    above = np.flatnonzero(values > greatest / 2)
    if not len(above) or above[0] == 0 or above[-1] == len(values) - 1:
        return None
    times = []
    for before in (above[0] - 1, above[-1]):
        share = (greatest / 2 - values[before]) / (values[before + 1] - values[before])
        times.append(time_ns[before] + share * (time_ns[before + 1] - time_ns[before]))
    return np.array(times)


def other_place(figures: RecordingFigures, tolerance: float) -> str:
    """Return where the guide went, if that is farther than ``tolerance`` [mm] from what the label says; else ""."""
    episode = figures.recording.episode
    press = episode.press
    if not episode.complete or not figures.recording.moves or press.depth < CONTACT:
        return ""
    went = episode.tip[int(np.argmax(episode.tip[:, 2]))]
    said = np.array([press.x, press.y, press.deepest])
    if np.abs(went - said).max() <= tolerance:
        return ""
    where = [f"x {x:.2f}, y {y:.2f}, depth {depth:.2f} mm" for x, y, depth in (went, said)]
    return f"the guide went to {where[0]}, and the label says {where[1]}"


def missing_ends(figures: RecordingFigures) -> tuple[float, float]:
    """Return for how long the first and the last phase have no readings [ms], negative where they have."""
    episode = figures.recording.episode
    time_ns, phases = episode.taxels.sample_ns, episode.phases
    if not phases or not len(time_ns) or not episode.complete:
        return 0.0, 0.0
    return float(time_ns[0] - phases[0].start_ns) / 1e6, float(phases[-1].end_ns - time_ns[-1]) / 1e6


def slip(found: Answers) -> tuple[int, np.ndarray] | None:
    """Return the press from which the answers lie elsewhere, and by how much [mm], shape (2,); None if they do not."""
    centers = found.taxels.centers
    low, high = centers.min(axis=0) + INSIDE, centers.max(axis=0) - INSIDE
    rows = np.flatnonzero(np.all((found.sites > low) & (found.sites < high), axis=1))
    if len(rows) < 2 * FEWEST:
        return None
    weight = np.maximum(found.response[rows], 0.0) ** 2
    total = weight.sum(axis=1)
    if not total.all():
        return None
    sites = found.sites[rows]
    off = (weight[:, :, None] * centers).sum(axis=1) / total[:, None] - sites
    base = np.column_stack([np.ones(len(rows)), sites]).astype(float)
    best: tuple[float, int, np.ndarray] | None = None
    for at in range(FEWEST, len(rows) - FEWEST + 1):
        design = np.column_stack([base, (np.arange(len(rows)) >= at).astype(float)])
        solved, *_ = np.linalg.lstsq(design, off, rcond=None)
        spread = ((off - design @ solved) ** 2).sum(axis=0) / max(len(rows) - design.shape[1], 1)
        error = np.sqrt(spread * np.linalg.pinv(design.T @ design)[-1, -1])
        sure = float((np.abs(solved[-1]) / np.maximum(error, 1e-9)).max())
        if best is None or sure > best[0]:
            best = sure, at, solved[-1]
    if best is None or best[0] < SLIP[1] or np.abs(best[2]).max() < SLIP[0]:
        return None
    return int(rows[best[1]]), best[2]
