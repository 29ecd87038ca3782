"""Allowed positions of the guide at each moment, by the moves sent; every status report is compared with it."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from tacdata.devices.device import CncStatus
from tacdata.errors import DeviceError
from tacdata.recording.motion.trapezoid import AxisLimits, Trapezoid

TOLERANCE = 0.05
"""Distance from the path that is still on it [mm], beyond the resolution of a report."""
EARLY = (1.05, 0.05)
"""By how much a move may seem to run ahead: this many times the time since it was sent, and so much more [s]. A
controller's own clock is good to a per cent; a move whose feed was damaged on the line runs far ahead."""
LATE = (1.3, 1.0)
"""Moves are behind if they take this many times as long as they should, and so much more [s]. Controllers that limit
the jerk take longer than a trapezoid, and one that is simulated waits for its computer."""
LEAST_WAY = 1.0
"""Distance that a guide may always have moved since a report [mm]."""
PAUSED = 0.8
"""Share of a pause, before its answer, in which the guide surely stands: firmwares round a pause to 50 ms."""
KEPT = 256
"""Moves that are remembered [count]: a busy host reads a report after several moves of a fast clock have ended."""


@dataclass
class _Leg:
    """One move that was sent, from rest to rest."""

    profile: Trapezoid
    sent_ns: int
    """No report before it can be of this move [ns]."""
    ended_ns: int | None = None
    """Host time by which it is known to have ended [ns]."""
    expected_ns: int | None = None
    """Host time at which it ends, if it was accepted and the controller obeys [ns]."""
    chain: float = 0.0
    """Duration of this move and of those before it, since the guide was last idle [s]."""

    @property
    def due_ns(self) -> int | None:
        """Host time after which it is behind [ns]; None if it was not accepted yet."""
        slack = round(((LATE[0] - 1) * self.chain + LATE[1]) * 1e9)
        return None if self.expected_ns is None else self.expected_ns + slack


class AllowedPath:
    """The moves that may be under way.

    One thread sends and another one reads reports: a move is entered before it is sent. A report that was asked for
    at q and came at r may show every move sent before r and not known to have ended before q, and of each move only
    the part that its speed allows since it was sent. On a host that stalls, an answer may belong to a query that was
    given up; so q is that of the report before.

    Example:
        ``path.stand((0, 0, 0), now); path.move((0, 0, -5), 1.0, now); path.off(status)``
    """

    def __init__(self, limits: AxisLimits, resolution: float) -> None:
        """Begin without a known place; ``resolution`` [mm] is the error of a report at rest."""
        self._limits, self._tolerance = limits, TOLERANCE + resolution
        self._legs: list[_Leg] = []
        self._since_ns = self._asked_ns = 0
        self._seen: CncStatus | None = None  # the latest report that lay on the path
        self._latest: deque[tuple[int, CncStatus]] = deque(maxlen=2)  # the latest reports, and when each was asked for
        self._lock = threading.Lock()

    def stand(self, position: tuple[float, float, float], now_ns: int) -> None:
        """Set the guide's ``position`` [mm]; nothing else is allowed until a move is sent.

        Where the moves so far lead there, they are kept: a report of one of them may still be read. Else reports that
        were asked for before ``now_ns`` are not judged.
        """
        place = np.array(position, float)
        with self._lock:
            if self._legs and np.allclose(self._legs[-1].profile.target, place, atol=1e-6):
                return
            self._since_ns = now_ns
            # A move without length allows reports of this one place.
            self._legs = [_Leg(self._limits.straight_move(place, place, 1.0), now_ns, now_ns)]

    def forget(self) -> None:
        """Take that nobody knows where the guide is: everything is allowed until `stand`."""
        with self._lock:
            self._legs = []

    def move(self, target: tuple[float, float, float], speed: float, now_ns: int) -> None:
        """Allow a straight move to ``target`` [mm] at ``speed`` [mm/s] that is about to be sent."""
        with self._lock:
            if self._legs:
                start = self._legs[-1].profile.target
                profile = self._limits.straight_move(start, np.array(target, float), speed)
                self._legs.append(_Leg(profile, now_ns))

    def taken(self, now_ns: int) -> None:
        """Take that the latest move was accepted: it ends in time from now on, or from the end of the one before."""
        with self._lock:
            if not self._legs:
                return
            leg, previous = self._legs[-1], self._legs[-2] if len(self._legs) > 1 else None
            # The controller queues moves: one that was taken early begins when the one before it ends.
            waits = previous is not None and previous.ended_ns is None and (previous.expected_ns or 0) > now_ns
            begins = previous.expected_ns if waits and previous else now_ns
            leg.chain = leg.profile.duration + (previous.chain if waits and previous else 0.0)
            leg.expected_ns = (begins or now_ns) + round(leg.profile.duration * 1e9)

    def rested(self, now_ns: int, pause: float = 0.0) -> DeviceError | None:
        """Take that every move so far has ended where it should, as the answer to a ``pause`` [s] after them says.

        Returns the fault of a pause that passed elsewhere: the moves before it were not carried out. One report may be
        damaged, so two have to agree.
        """
        with self._lock:
            begun_ns = now_ns - round(PAUSED * pause * 1e9)
            within = [status for asked_ns, status in self._latest if asked_ns >= begun_ns]
            leg = self._legs[-1] if self._legs else None
            if leg and len(within) == 2 and all(self._is_elsewhere(leg, status) for status in within):
                stands = np.linalg.norm(within[1].position - within[0].position) <= self._tolerance
                return _dropped(leg, within[1]) if stands else _answered_too_early(leg, within[1])
            for leg in self._legs:
                leg.ended_ns = leg.ended_ns or now_ns
            # Without the older moves, reports from their time cannot be judged.
            for leg in self._legs[:-KEPT]:
                self._since_ns = max(self._since_ns, leg.ended_ns or now_ns)
            self._legs = self._legs[-KEPT:]
        return None

    def off(self, status: CncStatus) -> DeviceError | None:
        """Return the fault of a reported position, or None."""
        with self._lock:
            # An answer may belong to the query before, so the earlier of the two bounds the report's age.
            asked_ns, self._asked_ns = min(self._asked_ns, status.sent_ns), status.sent_ns
            self._latest.append((asked_ns, status))
            sent = [leg for leg in self._legs if leg.sent_ns <= status.arrival_ns] or self._legs[:1]
        if not sent or asked_ns < self._since_ns:
            return None
        x, y, z = status.position.tolist()
        # The last move sent, and those that may have run since the query; of a move that had ended, only its end.
        legs = [leg for leg in sent if leg is sent[-1] or leg.ended_ns is None or leg.ended_ns >= asked_ns]
        nearest, distance, laggard = None, np.inf, None
        for leg in legs:
            deviation, is_ahead = self._distance(leg, asked_ns, status)
            # One move that explains the report is enough: the guide may be in any of those sent.
            if deviation <= self._tolerance and not is_ahead:
                if not self._is_behind(leg, asked_ns, status):
                    self._seen = status
                    return None
                laggard = leg
            if deviation < distance:
                nearest, distance = leg, deviation
        if laggard:
            return _dropped(laggard, status) if status.state == "Idle" else _slow(laggard, asked_ns, status)
        if far := self.out_of_reach((x, y, z), status.arrival_ns):
            return DeviceError(
                f"the guide cannot be where a report says: {far}",
                "reports that follow one from the other",
                "that report was damaged on its way (check the controller's cable and ground), or the controller lost "
                "its count; look whether it stands where it says, then start again",
            )
        if earlier := self._believed_ended(sent, status):
            return _answered_too_early(earlier, status)
        leg = nearest or legs[-1]
        ways = f"from {_text(leg.profile.start)} to {_text(leg.profile.target)} mm"
        is_ahead = distance <= self._tolerance
        how = (
            f"farther on its way {ways} than its speed allows" if is_ahead else f"{distance:.2f} mm off its way {ways}"
        )
        return DeviceError(
            f"the guide reports {_text(status.position)} mm, {how}",
            f"at most {self._tolerance:.2f} mm off the way that it was sent, at the speed that it was given",
            "look where it stands: a line was damaged on its way (check cable and ground), something bends the "
            "coordinates ($G), or steps were lost; home or touch off if it does not stand where it says",
        )

    def is_short(self, target: tuple[float, float, float], position: tuple[float, float, float]) -> bool:
        """Whether ``position`` [mm] is below or off the end of a way straight up; higher is clear as well."""
        x, y, z = np.subtract(position, target)
        return float(np.hypot(x, y)) > self._tolerance or z < -self._tolerance

    def _believed_ended(self, sent: list[_Leg], status: CncStatus) -> _Leg | None:
        """Return the latest move with the reported place on its way, though an answer reported its end."""
        for leg in reversed(sent[:-1]):
            profile, place = leg.profile, status.position
            if leg.ended_ns is None or np.linalg.norm(place - profile.target) <= self._tolerance or not profile.length:
                continue
            progress = float(np.clip(profile.progress(place[None])[0], 0.0, profile.length))
            way = profile.start + progress / profile.length * (profile.target - profile.start)
            if np.linalg.norm(place - way) <= self._tolerance:
                return leg
            return None
        return None

    def out_of_reach(self, position: tuple[float, float, float], now_ns: int) -> str:
        """Return in words why the guide cannot stand at ``position`` [mm] by ``now_ns``; empty if it can."""
        if self._seen is None:
            return ""
        gone = float(np.linalg.norm(np.array(position) - self._seen.position))
        seconds = (now_ns - self._seen.sent_ns) * 1e-9
        if gone <= float(np.linalg.norm(self._limits.max_rate)) * seconds + LEAST_WAY:
            return ""
        return (
            f"it says that it stands at {_text(np.array(position))} mm, and {seconds:.1f} s before it was at "
            f"{_text(self._seen.position)} mm: farther than it can have moved"
        )

    def _is_behind(self, leg: _Leg, asked_ns: int, status: CncStatus) -> bool:
        return leg.due_ns is not None and leg.due_ns < asked_ns and self._is_elsewhere(leg, status)

    def _is_elsewhere(self, leg: _Leg, status: CncStatus) -> bool:
        return float(np.linalg.norm(status.position - leg.profile.target)) > self._tolerance

    def _distance(self, leg: _Leg, asked_ns: int, status: CncStatus) -> tuple[float, bool]:
        """Return the distance of a report from the move [mm], and whether it is farther along than time allows."""
        profile, position = leg.profile, status.position
        if not profile.length or (leg.ended_ns is not None and leg.ended_ns < asked_ns):
            return float(np.linalg.norm(position - profile.target)), False
        progress = min(max(float(profile.progress(position[None])[0]), 0.0), profile.length)
        on = profile.start + progress / profile.length * (profile.target - profile.start)
        # The earliest start is when the line was sent; a controller may also be a little faster than its settings.
        since = EARLY[0] * (status.arrival_ns - leg.sent_ns) * 1e-9 + EARLY[1]
        is_ahead = progress > float(profile.distance(np.array([since]))[0]) + self._tolerance
        return float(np.linalg.norm(position - on)), is_ahead


def _slow(leg: _Leg, asked_ns: int, status: CncStatus) -> DeviceError:
    ways = f"from {_text(leg.profile.start)} to {_text(leg.profile.target)} mm"
    delay = (asked_ns - (leg.expected_ns or asked_ns)) * 1e-9
    return DeviceError(
        f"the guide reports {_text(status.position)} mm, still on its way {ways}, {delay:.1f} s too late",
        f"moves within {LATE[0]:g} times their duration and {LATE[1]:g} s",
        "set the feed override back to 100 % (a pendant may have changed it), and let $110 to $122 be what the machine "
        "can do; then start again",
    )


def _dropped(leg: _Leg, status: CncStatus) -> DeviceError:
    return DeviceError(
        f"the guide stands idle at {_text(status.position)} mm, still on its way from "
        f"{_text(leg.profile.start)} to {_text(leg.profile.target)} mm: the controller dropped the move",
        "a move that is carried out to its end",
        "see that no other program and no pendant uses this controller (one may empty its queue); check cable and "
        "ground; then start again",
    )


def _answered_too_early(leg: _Leg, status: CncStatus) -> DeviceError:
    ways = f"from {_text(leg.profile.start)} to {_text(leg.profile.target)} mm"
    return DeviceError(
        f"the guide reports {_text(status.position)} mm, still on its way {ways}, which an answer said had ended",
        "an answer to a pause when the move before it has ended",
        "see that no other program and no second controller uses this line (one may answer, or stop grblHAL with 0x19, "
        "which can lose steps); check cable and ground; then start again",
    )


def _text(position: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"
