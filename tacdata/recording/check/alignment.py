"""Do readings, motion and label belong together: in time, in place, and to the end?"""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.idle import idle_rows

CONTACT = 0.3
"""Depth from which a press is used [mm]."""
CLEAR = 20.0
"""Answer from which its time can be told [times the noise]."""
FEW = 10
"""Readings without contact that are needed [count]."""
FELT = 0.25
"""Share of a press's greatest answer at which its height is taken [1]: low, as a curved answer moves high shares."""


def reading_lag(figures: RecordingFigures) -> float | None:
    """Return how much later the readings come than the motion [ms]; None where it cannot be told.

    Taken where answer and depth cross half of their greatest value, going in and coming out. A curved answer moves
    both crossings in opposite ways, so the mean is the delay. What remains is the skin's own: its creep and hysteresis.
    """
    felt, episode = _felt(figures, 0.5), figures.recording.episode
    if felt is None:
        return None
    depth = np.maximum(episode.tip_at(episode.taxels.sample_ns)[:, 2], 0.0)
    gone = _crossings(depth, float(depth.max()), 0.5, episode.taxels.sample_ns)
    return None if gone is None else float(np.mean(felt - gone) / 1e6)


def height_felt(figures: RecordingFigures) -> float | None:
    """Return the depth at which `FELT` of the press's greatest answer is felt [mm]; None where it cannot be told.

    The mean of going in and coming out, in which a delay cancels. A gain does not enter.
    """
    felt = _felt(figures, FELT)
    return None if felt is None else float(figures.recording.episode.tip_at(felt)[:, 2].mean())


def _felt(figures: RecordingFigures, share: float) -> np.ndarray | None:
    """Return when the clearest channel first passes a share of its greatest answer, and when last [ns], shape (2,)."""
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
    return _crossings(np.abs(change[:, channel]), float(greatest[channel]), share, time_ns)


def loading(figures: RecordingFigures) -> float:
    """Return how long the way in takes [ms]: a skin with hysteresis leads or lags by a share of it."""
    press = figures.recording.episode.press
    return 1e3 * press.deepest / press.speed


def _crossings(values: np.ndarray, greatest: float, share: float, time_ns: np.ndarray) -> np.ndarray | None:
    """Return when a share of the greatest value is first passed upwards and last downwards [ns], shape (2,)."""
    above = np.flatnonzero(values > share * greatest)
    if not len(above) or above[0] == 0 or above[-1] == len(values) - 1:
        return None
    times = []
    for before in (above[0] - 1, above[-1]):
        part = (share * greatest - values[before]) / (values[before + 1] - values[before])
        times.append(time_ns[before] + part * (time_ns[before + 1] - time_ns[before]))
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


def ends_before_reports(figures: RecordingFigures) -> float:
    """Return for how long the controller still reports after the last reading has arrived [ms]."""
    episode = figures.recording.episode
    if not len(episode.taxels.arrival_ns) or not len(episode.cnc.arrival_ns) or not episode.complete:
        return 0.0
    return float(episode.cnc.arrival_ns[-1] - episode.taxels.arrival_ns[-1]) / 1e6
