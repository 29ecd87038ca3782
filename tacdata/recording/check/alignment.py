"""Do readings, motion and label belong together: in time, in place, and to the end?"""

from __future__ import annotations

import numpy as np

from tacdata.recording.check.figures import RecordingFigures
from tacdata.recording.check.idle import idle_rows
from tacdata.recording.files.reader import Recording
from tacdata.recording.motion.move_times import AnchoredMove

CONTACT = 0.3
"""Depth from which a press is used [mm]."""
CLEAR = 20.0
"""Answer from which its time can be estimated [times the noise]."""
FEW = 10
"""Readings without contact that are needed [count]."""
FELT = 0.25
"""Share of a press's greatest answer at which its height is taken [1]: low, as a curved answer moves high shares."""

UNKNOWN_MS = 300.0
"""Latest sign that a move has ended, beyond the reports' interval [ms of real time]. Grbl's pauses take 50 ms more."""
NEAR = 0.02
"""Distance from the target at which a move has ended [mm], beyond a report's resolution."""


def reading_lag(figures: RecordingFigures) -> float | None:
    """Return how much later the readings come than the motion [ms]; None where it cannot be estimated.

    Taken where answer and depth cross half of their greatest value, going in and coming out. A curved answer moves
    both crossings in opposite ways, so the mean is the delay. The skin's own delay remains: its creep and hysteresis.
    """
    # At half of the answer the curve is steepest, so noise moves the crossing least.
    felt, episode = _felt(figures, 0.5), figures.recording.episode
    if felt is None:
        return None
    # Above the skin nothing answers, so heights above it are not compared.
    depth = np.maximum(episode.tip_at(episode.taxels.sample_ns)[:, 2], 0.0)
    gone = _crossings(depth, float(depth.max()), 0.5, episode.taxels.sample_ns)
    # The mean of the way in and out: friction and relaxation delay one and advance the other.
    return None if gone is None else float(np.mean(felt - gone) / 1e6)


def height_felt(figures: RecordingFigures) -> float | None:
    """Return the depth at which `FELT` of the press's greatest answer is felt [mm]; None where it cannot be estimated.

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
    # A quantised channel may rest on one count; half a count is then its noise.
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
    # A crossing needs a reading on either side of it.
    if not len(above) or above[0] == 0 or above[-1] == len(values) - 1:
        return None
    times = []
    for index in (above[0] - 1, above[-1]):
        part = (share * greatest - values[index]) / (values[index + 1] - values[index])
        times.append(time_ns[index] + part * (time_ns[index + 1] - time_ns[index]))
    return np.array(times)


def other_place(figures: RecordingFigures, tolerance: float) -> str:
    """Return where the guide went, if that is farther than ``tolerance`` [mm] from the label's path; else ""."""
    episode = figures.recording.episode
    press = episode.press
    if not episode.complete or not figures.recording.moves or press.depth < CONTACT:
        return ""
    # The deepest point. On the way there the guide is at other places by plan.
    went = episode.tip[int(np.argmax(episode.tip[:, 2]))]
    nominal = np.array([press.x, press.y, press.deepest])
    if np.abs(went - nominal).max() <= tolerance:
        return ""
    where = [f"x {x:.2f}, y {y:.2f}, depth {depth:.2f} mm" for x, y, depth in (went, nominal)]
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


def stood_still(figures: RecordingFigures, rate: float) -> float:
    """Return for how long the controller may have stood still on a way in or out [ms]; 0 if it cannot have.

    A profile takes it that a move is never interrupted. A controller that stalls reports nothing, and answers the pause
    behind the move later. If this computer stalls, the readings come late, too, and nothing is reported.

    Args:
        figures: Figures of the recording.
        rate: Speed of the recording's clock [1].
    """
    recording, standstill = figures.recording, 0.0
    arrival = recording.episode.cnc.arrival_ns
    if len(arrival) < 2:
        return 0.0
    # Between two reports a standstill cannot be seen, so only more than the usual interval counts.
    usual = float(np.median(np.diff(arrival))) + UNKNOWN_MS * 1e6 * rate
    # An interrupted recording ends within its last move, which did not run to its end.
    moves = recording.moves if recording.episode.complete else recording.moves[:-1]
    for move, following in zip(moves, [*recording.moves[1:], None], strict=False):
        later = _ended_by(recording, move, following) - move.end_ns
        # Only there does a standstill falsify a depth that a label is computed for.
        inside = move.command.phase in ("press", "release") and move.profile.length
        if inside and usual < later < np.inf and not _host_was_late(recording, move, later):
            standstill = max(standstill, later / 1e6)
    return standstill


def _ended_by(recording: Recording, move: AnchoredMove, following: AnchoredMove | None) -> float:
    """Return the host time by which a move is known to have ended [ns]; infinite if nothing shows it.

    The next one is sent when the pause behind it was answered. Strokes are over before a report shows their ends.
    """
    episode, stream = recording.episode, recording.episode.cnc
    distance = np.linalg.norm(stream.position - move.profile.target, axis=1)
    arrivals = stream.arrival_ns[(distance < NEAR + recording.height_resolution) & (stream.arrival_ns > move.start_ns)]
    ends = [float(arrivals[0])] if len(arrivals) else []
    hold = next((phase for phase in episode.phases if phase.name == "hold"), None)
    if hold is not None and move.command.phase == "press":
        # The end of the hold is an acknowledgement, and its length is known: the press ended before it began.
        ends.append(hold.end_ns - episode.press.hold * 1e9)
    if following is not None:
        ends.append(following.command.sent_ns)
    return min(ends, default=np.inf)


def _host_was_late(recording: Recording, move: AnchoredMove, later: float) -> bool:
    """Return whether readings, too, came late when the move should have ended."""
    arrival = recording.episode.taxels.arrival_ns
    gaps = np.diff(arrival, prepend=move.start_ns, append=move.end_ns + later)
    begin, end = np.append(move.start_ns, arrival), np.append(arrival, move.end_ns + later)
    overlap = (begin < move.end_ns + later) & (end > move.start_ns)
    return float(np.max(gaps[overlap], initial=0)) > later / 2
