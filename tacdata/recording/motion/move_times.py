"""Estimates when each commanded move ran: its start, bracketed by acknowledgements and status reports.

The position cannot be sampled at the sensor's rate (GRBL answers `?` at 5 to 10 Hz). But each move's profile is known,
so only its start t0 is missing. These bounds hold:

1. The move starts after the command was sent.

2. A controller at rest starts at the latest one planner's turn after its `ok`.

3. A report of progress s, queried at q and answered at r, gives ``q - tau(s + e) <= t0 <= r - tau(s - e)``. Here tau is
the inverse of the profile and e the largest deviation of a report from it.

4. A pause behind the move is acknowledged after the move's end.

Grbl writes `ok` when a move is planned and starts it in the next turn of its main loop (`protocol.c`). So of the times
within all bounds, the start is the one nearest to the middle between sending and that turn after the quickest `ok`. Its
uncertainty is the distance to the farther bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.recording.episode import PHASES, CncStream, Phase
from tacdata.recording.motion.trapezoid import AxisLimits, Trapezoid

LAST_DIGIT = 0.0005
"""Half of a report's last digit [mm]: three decimals."""
UNKNOWN_STEP = 0.0025
"""Size of a motor's step where the controller does not give it [mm]: 400 steps/mm."""
SEGMENT = 0.01
"""Time over which Grbl steps at constant speed [s]: 1/ACCELERATION_TICKS_PER_SECOND of its `config.h`. `stepper.c`
distributes each segment's steps evenly, so a ramp deviates from the profile by up to a t^2 / 8.
"""
PLANNER_TURN_NS = 5_000_000
"""Longest time from a command's `ok` at the host to its first step [ns]; measured with Grbl 1.1h on a host: 3 ms."""


@dataclass(frozen=True)
class Command:
    """One acknowledged move or pause, as recorded."""

    phase: str
    """Phase it belongs to; empty for travel."""
    start: np.ndarray
    """Machine position before [mm], shape (3,)."""
    target: np.ndarray
    """Machine position after [mm], shape (3,)."""
    speed: float
    """Commanded speed [mm/s]; 0 for a pause."""
    dwell: float
    """Commanded pause [s]; 0 for a move."""
    sent_ns: int
    """Host time of sending [ns]."""
    acknowledged_ns: int
    """Host time of the `ok` [ns]."""
    line: str = ""
    """The line as sent."""

    @property
    def is_move(self) -> bool:
        """True for a move, False for a pause."""
        return self.speed > 0


@dataclass(frozen=True)
class AnchoredMove:
    """A move with its estimated start."""

    command: Command
    profile: Trapezoid
    start_ns: int
    """Estimated start [ns]."""
    uncertainty_ns: int
    """Distance from the start to the farther of its bounds [ns]."""
    contradiction_ns: int
    """By how much the bounds contradict each other [ns]; 0 if they agree."""

    @property
    def end_ns(self) -> int:
        """Estimated end [ns]."""
        return self.start_ns + round(self.profile.duration * 1e9)


@dataclass(frozen=True)
class StatusTimes:
    """Status reports with both their host times."""

    sent_ns: np.ndarray
    """Host time of each query [ns], shape (m,)."""
    stream: CncStream


def report_resolution(settings: dict[str, str]) -> np.ndarray:
    """Return the largest difference between reported and commanded position at rest [mm], shape (3,).

    It is half of the report's last digit and one motor step, by GRBL's ``$100`` to ``$102`` [steps/mm]
    (doc/markdown/settings.md). In inches (``$13``) a digit is 25.4 times a tenth as long.
    """
    steps = np.array([_number(settings.get(f"$10{axis}", "")) for axis in range(3)])
    digit = LAST_DIGIT * (2.54 if _number(settings.get("$13", "")) else 1.0)
    return digit + np.where(steps > 0, 1.0 / np.where(steps > 0, steps, 1.0), UNKNOWN_STEP)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def anchor(
    commands: list[Command], statuses: StatusTimes, limits: AxisLimits, resolution: np.ndarray | None = None
) -> list[AnchoredMove]:
    """Return every move with its estimated start.

    Args:
        commands: Moves and pauses in the order of sending; each move starts from rest.
        statuses: All reports of the recording.
        limits: The controller's axis limits.
        resolution: From `report_resolution` [mm], shape (3,); None if the controller's settings are not known.
    """
    anchored = []
    resolution = report_resolution({}) if resolution is None else resolution
    # A controller takes a line, plans, answers and starts in the same time each time. If an `ok` takes longer than the
    # quickest one, host and link caused that.
    quickest = min((c.acknowledged_ns - c.sent_ns for c in commands if c.is_move), default=0)
    for index, command in enumerate(commands):
        if command.is_move:
            following = commands[index + 1] if index + 1 < len(commands) else None
            anchored.append(_anchor_move(command, following, statuses, limits, (quickest, resolution)))
    return anchored


def _anchor_move(
    command: Command,
    following: Command | None,
    statuses: StatusTimes,
    limits: AxisLimits,
    precision: tuple[int, np.ndarray],
) -> AnchoredMove:
    quickest, resolution = precision
    profile = limits.straight_move(command.start, command.target, command.speed)
    earliest, latest = [command.sent_ns], [command.acknowledged_ns + PLANNER_TURN_NS]
    if following is not None:
        end = following.sent_ns if following.is_move else following.acknowledged_ns - round(following.dwell * 1e9)
        latest.append(max(end + PLANNER_TURN_NS - round(profile.duration * 1e9), command.sent_ns))
    if profile.length:
        lower_bounds, upper_bounds = _report_bounds(profile, command, following, statuses, resolution)
        earliest, latest = earliest + lower_bounds, latest + upper_bounds
    # Every bound is hard, so their intersection is, too. An empty one means that reports contradict the profile; half
    # of the conflict is then the uncertainty.
    low, high = max(earliest), min(latest)
    if low > high:
        return AnchoredMove(command, profile, (low + high) // 2, (low - high) // 2, low - high)
    start = min(max(command.sent_ns + (quickest + PLANNER_TURN_NS) // 2, low), high)
    return AnchoredMove(command, profile, start, max(start - low, high - start), 0)


def _report_bounds(
    profile: Trapezoid, command: Command, following: Command | None, statuses: StatusTimes, resolution: np.ndarray
) -> tuple[list[int], list[int]]:
    until = following.acknowledged_ns if following is not None else np.iinfo(np.int64).max
    mask = (statuses.sent_ns >= command.sent_ns) & (statuses.stream.arrival_ns <= until)
    if not mask.any():
        return [], []
    sent, arrival = statuses.sent_ns[mask], statuses.stream.arrival_ns[mask]
    progress = profile.progress(statuses.stream.position[mask])
    direction = np.abs(profile.target - profile.start) / profile.length
    # A report is rounded, and Grbl plans in segments, whose corners cut the ramps by this much.
    margin = float(direction @ resolution) + profile.acceleration * min(SEGMENT**2 / 8, profile.ramp**2 / 2)
    # A report at rest before the move bounds no latest start, and one at its end no earliest start.
    has_begun, unfinished = progress > margin, progress < profile.length - margin
    latest = arrival - _nanoseconds(profile.time(progress - margin))
    earliest = sent - _nanoseconds(profile.time(progress + margin))
    return earliest[unfinished].tolist(), latest[has_begun].tolist()


def _nanoseconds(seconds: np.ndarray) -> np.ndarray:
    return np.rint(seconds * 1e9).astype(np.int64)


def machine_path(moves: list[AnchoredMove], statuses: CncStream, complete: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the path as knots: increasing times [ns], shape (k,), and positions [mm], shape (k, 3).

    In an interrupted recording the profile ends where its last move was sent; from there on the reports are used.
    """
    times: list[np.ndarray] = [np.empty(0, np.int64)]
    positions: list[np.ndarray] = [np.empty((0, 3))]
    trusted = moves if complete else moves[:-1]
    for move in trusted:
        time, position = move.profile.knots()
        times.append(move.start_ns + _nanoseconds(time))
        positions.append(position)
    if len(trusted) < len(moves) or not moves:
        since = moves[-1].command.sent_ns if moves else np.iinfo(np.int64).min
        mask = statuses.sample_ns > since
        times.append(statuses.sample_ns[mask])
        positions.append(statuses.position[mask])
    time, position = np.concatenate(times), np.concatenate(positions)
    # Neighbouring estimates may overlap by their errors, and times must increase.
    order = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]]) if len(time) else np.empty(0, bool)
    return time[order], position[order]


def phases(commands: list[Command], moves: list[AnchoredMove]) -> tuple[Phase, ...]:
    """Return the phases: a move's estimated times; a pause lasts from the move before to its own `ok`."""
    begins: dict[str, int] = {}
    ends: dict[str, int] = {}
    by_command = {id(move.command): move for move in moves}
    still_since = None
    for command in commands:
        move = by_command.get(id(command))
        start = move.start_ns if move else (still_since or command.sent_ns)
        end = move.end_ns if move else max(command.acknowledged_ns, start)
        if move:
            still_since = end
        if command.phase:
            begins.setdefault(command.phase, start)
            ends[command.phase] = end
    starts = sorted((begins[name], name) for name in begins if name in PHASES)
    bounds = [*(start for start, _ in starts), np.iinfo(np.int64).max][1:]
    # A phase never overlaps the next one, whatever the errors of two neighbouring estimates.
    return tuple(
        Phase(name, start, min(ends[name], bound)) for (start, name), bound in zip(starts, bounds, strict=True)
    )
