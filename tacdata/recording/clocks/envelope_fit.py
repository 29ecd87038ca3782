"""Fits a stream's clock under the lower envelope of its arrivals, while they come.

A least squares line would be late by the mean latency (9 ms behind an FTDI adapter, whose latency timer is 16 ms). The
line here is below all points and has the smallest sum of distances: the edge of their lower convex hull under the
mean counter (Moon, Skelly and Towsley, INFOCOM 1999).

Frames that arrive late for a moment (a stalled host) return to the line. Frames that stay late for seconds, or come too
early, show that the device's clock stepped. A new line begins there.

A few seconds of arrivals determine the slope badly. Until the arrivals contradict it, the nominal period bounds the
slope.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tacdata.recording.clocks.clock_model import ClockModel

BLOCK_NS = 4_000_000_000
"""Length of a block of arrivals; each block's smallest latency is used [ns]."""
BLOCKS = 75
"""Blocks that a running fit keeps: five minutes, over which drift is linear."""
LATE_NS = 20_000_000
"""Lateness that is a step of the device's clock if it lasts [ns]; at least 0.6 periods."""
LASTING_NS = 1_000_000_000
"""How long lateness must last to be a step [ns]; a host stall ends in a backlog that returns to the line."""
LASTING_FRAMES = 20
"""... and for how many frames."""
RETURN_NS = 60_000_000_000
"""Time after a step within which a frame on the old line shows that the host was late and nothing stepped [ns]."""
EARLY_NS = 100_000_000
"""Arrival before the line that no latency explains [ns]; at least 2.5 periods."""
DRIFT = 500e-6
"""Change of the period that is allowed for in a silent gap [1]."""
TYPICAL = 1.2
"""Root mean square over median of a latency that is uniform from 0 [1]."""
HIDDEN = 0.1
"""Share of the typical latency that may stay hidden in every block [1]: 1.6 ms of a 16 ms timer."""
STALLED = 3.0
"""Mean latency of a block over the median of all blocks, besides `LATE_NS`, that shows a stalled host [1]."""
CRYSTAL = 250e-6
"""Largest deviation of a crystal from its nominal rate [1]: three times that of a poor one."""
KEPT = 32
"""Arrivals of a block that are kept for the typical latency [count]."""
EARLIER = 16
"""Lines before steps that are kept."""

Point = tuple[int, int]


def append_to_hull(hull: list[Point], point: Point) -> None:
    """Add a (counter, arrival) point right of all others to a lower convex hull, in exact integers."""
    while len(hull) >= 2:
        (x1, y1), (x2, y2) = hull[-2:]
        # Slopes rise along a lower hull; a middle point that breaks this is above the chord.
        if (x2 - x1) * (point[1] - y1) > (y2 - y1) * (point[0] - x1):
            break
        hull.pop()
    hull.append(point)


class _Block:
    """A few seconds of arrivals: their hull and their sums, relative to an origin."""

    def __init__(self, begin_ns: int) -> None:
        self.begin_ns = begin_ns
        self.hull: list[Point] = []
        self.first: list[Point] = []
        self.sums = [0, 0, 0, 0, 0, 0]  # frames, x, y, xx, xy, yy

    def add(self, point: Point, origin: Point) -> None:
        append_to_hull(self.hull, point)
        if len(self.first) < KEPT:
            self.first.append(point)
        x, y = point[0] - origin[0], point[1] - origin[1]
        self.sums = [a + b for a, b in zip(self.sums, (1, x, y, x * x, x * y, y * y), strict=True)]


class _Stretch:
    """Arrivals between two steps of the device's clock."""

    def __init__(self, nominal_ns: float | None = None) -> None:
        self.nominal_ns = nominal_ns
        self.blocks: list[_Block] = []
        self.hull: list[Point] = []
        self.origin: Point = (0, 0)
        self.last: Point = (-1, 0)
        self.frames = 0
        self._total = 0  # of the counters beyond the origin's, within the blocks
        self._count = 0
        self._doubt = (0, math.inf)  # frames at the last evaluation, and its result [ns]

    def add(self, point: Point) -> None:
        if not self.frames:
            self.origin = point
        # Blocks let the fit forget: a crystal drifts with temperature over hours.
        if not self.blocks or point[1] - self.blocks[-1].begin_ns > BLOCK_NS:
            self._begin_block(point)
        self.blocks[-1].add(point, self.origin)
        append_to_hull(self.hull, point)
        self.last, self.frames = point, self.frames + 1
        self._total, self._count = self._total + point[0] - self.origin[0], self._count + 1

    def _begin_block(self, point: Point) -> None:
        self.blocks.append(_Block(point[1]))
        if len(self.blocks) > BLOCKS:
            gone = self.blocks.pop(0)
            self._count, self._total = self._count - gone.sums[0], self._total - gone.sums[1]
            # The hull of all arrivals is the hull of the blocks' hulls.
            self.hull = []
            for vertex in (p for block in self.blocks for p in block.hull):
                append_to_hull(self.hull, vertex)

    def established(self, rate: float) -> bool:
        return self.frames >= LASTING_FRAMES and self.last[1] - self.origin[1] >= LASTING_NS * rate

    def merge(self, later: _Stretch) -> None:
        """Merge a later block that turned out to belong to this one, arriving late; only its hull matters."""
        for point in later.hull:
            self.add(point)
        self.frames += later.frames - len(later.hull)

    def frame_ns(self) -> float:
        """Mean time between frames [ns]."""
        return (self.last[1] - self.origin[1]) / max(self.frames - 1, 1)

    @property
    def span_ns(self) -> int:
        """Time over which arrivals are kept [ns], at least 1."""
        return max(self.last[1] - self.blocks[0].begin_ns, 1) if self.blocks else 1

    def uncertainty_ns(self) -> float:
        """Return the uncertainty of the line within its span [ns], evaluated from time to time."""
        frames, doubt = self._doubt
        if self.frames >= frames + max(frames // 16, LASTING_FRAMES):
            line = self._free_line()
            _, jitter, doubt = (0.0, 0.0, math.inf) if line is None else self._spread(line)
            # With few blocks to compare, all of them may have been late.
            self._doubt = self.frames, doubt if len(self.blocks) > 3 else max(doubt, jitter)
        return doubt

    def line(self) -> tuple[int, int, float] | None:
        """Return a point on the line and its slope, or None before two different counters are known."""
        estimate = self._free_line()
        if estimate is None or self.nominal_ns is None:
            return estimate
        # A short recording bounds the slope worse than a crystal's tolerance does.
        slope = min(max(estimate[2], self.nominal_ns * (1 - CRYSTAL)), self.nominal_ns * (1 + CRYSTAL))
        deviation = abs(slope - estimate[2])
        if deviation == 0 or deviation > self.nominal_ns * 2 * self.uncertainty_ns() / self.span_ns:
            return estimate  # the bound by the arrivals outweighs the nominal rate
        x0, y0 = min(self.hull, key=lambda point: point[1] - self.origin[1] - slope * (point[0] - self.origin[0]))
        return x0, y0, slope

    def _free_line(self) -> tuple[int, int, float] | None:
        hull = self.hull
        if len(hull) < 2:
            return None
        # The hull's edge below the mean of the counters is the line that minimizes the sum of latencies (a linear
        # programme).
        mean = self.origin[0] + self._total / self._count
        edge = next((i for i in range(1, len(hull) - 1) if hull[i][0] >= mean), len(hull) - 1)
        (x1, y1), (x2, y2) = hull[edge - 1], hull[edge]
        slope = (y2 - y1) / (x2 - x1)
        return (x1, y1, slope) if math.isfinite(slope) and slope > 0 else None

    def model(self, axis: str) -> ClockModel | None:
        line = self.line()
        if line is None:
            return None
        x0, y0, slope = line
        delay, jitter, uncertainty = self._spread(line)
        # Either end of the line may be off by the uncertainty; a nominal rate bounds it by the crystal's tolerance.
        drift = 2 * uncertainty / self.span_ns
        drift = drift if line == self._free_line() else min(drift, 2 * CRYSTAL)
        arrivals = self.frames, self.origin[1]
        return ClockModel(x0, y0, slope, *arrivals, max(delay, 0.0), jitter, uncertainty, drift, axis)

    def _spread(self, line: tuple[int, int, float]) -> tuple[float, float, float]:
        """Return mean and standard deviation of the latencies above a line, and its uncertainty [ns]."""
        x0, y0, slope = line
        n, sx, sy, sxx, sxy, syy = (sum(parts) for parts in zip(*self._usual_sums(line), strict=True))
        # The sums are exact integers: in floating point these differences would cancel.
        variance = ((n * syy - sy * sy) - 2 * slope * (n * sxy - sx * sy) + slope**2 * (n * sxx - sx * sx)) / n**2
        jitter = math.sqrt(max(variance, 0.0))
        delay = sy / n + self.origin[1] - y0 - slope * (sx / n + self.origin[0] - x0)
        # The last block is still being filled.
        blocks = self.blocks[:-1] or self.blocks
        minima = [min(y - y0 - slope * (x - x0) for x, y in block.hull) for block in blocks]
        usual = np.median([y - y0 - slope * (x - x0) for block in self.blocks for x, y in block.first])
        # Latencies that come in steps (a latency timer) can hide the same part in every block.
        uncertainty = max(TYPICAL * float(np.median(minima)), HIDDEN * float(usual))
        if len(blocks) < 3:  # too short to compare blocks: the scatter of the mean is the bound
            uncertainty = max(uncertainty, jitter / math.sqrt(n))
        return delay, jitter, uncertainty

    def _usual_sums(self, line: tuple[int, int, float]) -> list[list[int]]:
        """Return the sums of the blocks whose mean latency is usual: a stall of minutes ago is none of the link's."""
        x0, y0, slope = line
        rows = [block.sums for block in self.blocks]
        mean = [s[2] / s[0] + self.origin[1] - y0 - slope * (s[1] / s[0] + self.origin[0] - x0) for s in rows]
        limit = STALLED * float(np.median(mean)) + LATE_NS
        return [s for s, latency in zip(rows, mean, strict=True) if latency <= limit]


class EnvelopeFit:
    """A fit that goes on while frames arrive; only hulls and sums are kept, so memory and time stay small."""

    def __init__(self, axis: str = "counter", rate: float = 1.0, nominal_ns: float | None = None) -> None:
        """Begin without arrivals.

        Args:
            axis: Argument of `add`: ``counter``, ``device_ns`` or ``order`` (see `ClockModel`).
            rate: Seconds that the host's clock shows per real second; host latencies grow with it.
            nominal_ns: Nominal time per count [ns], or 1 on the device's own time; None if unknown.
        """
        self.axis, self._rate = axis, rate
        self._nominal_ns = 1.0 if axis == "device_ns" else nominal_ns
        self._stretch = _Stretch(self._nominal_ns)
        self._before: _Stretch | None = None  # the block that a lasting lateness ended, while it may still return
        self._late: list[Point] = []
        self._earlier: list[ClockModel] = []

    def add(self, arrival_ns: int, counter: int) -> None:
        """Take one arrival [ns]; a counter that falls back (a device reset) starts a new line."""
        if counter < 0:
            return
        stretch, last = self._stretch, self._late[-1] if self._late else self._stretch.last
        # A repeated counter carries no time.
        if counter == last[0]:
            return
        # A device that was reset begins a line of its own, without a common origin.
        if counter < last[0]:
            self._begin([(counter, arrival_ns)])
            return
        if self._before is not None and self._came_back(self._before, (counter, arrival_ns)):
            return
        line = stretch.line() if stretch.established(self._rate) else None
        if line is None:
            stretch.add((counter, arrival_ns))
            return
        error = arrival_ns - line[1] - line[2] * (counter - line[0])
        period = stretch.frame_ns()
        # A line is less certain beyond the arrivals that it was fitted to.
        doubt = stretch.uncertainty_ns() * (1 + 2 * (arrival_ns - stretch.last[1]) / stretch.span_ns)
        if error < -max(EARLY_NS * self._rate, 2.5 * period) - DRIFT * (arrival_ns - stretch.last[1]) - doubt:
            self._begin([(counter, arrival_ns)])
        elif error > max(LATE_NS * self._rate, 0.6 * period) + doubt:
            self._wait_for_return((counter, arrival_ns))
        else:
            self._returned()
            stretch.add((counter, arrival_ns))

    def _wait_for_return(self, point: Point) -> None:
        self._late.append(point)
        first = self._late[0]
        if len(self._late) >= LASTING_FRAMES and point[1] - first[1] >= LASTING_NS * self._rate:
            ended = self._stretch
            self._begin(self._late)
            self._before = ended

    def _came_back(self, previous: _Stretch, point: Point) -> bool:
        """Undo a new line if a frame is on the old one again: then the host was late, and nothing stepped."""
        line = previous.line()
        if line is None or point[1] - previous.last[1] > RETURN_NS * self._rate:
            self._before = None
            return False
        error = point[1] - line[1] - line[2] * (point[0] - line[0])
        if abs(error) > max(LATE_NS * self._rate, 0.6 * previous.frame_ns()):
            return False
        previous.merge(self._stretch)
        backlog, self._late = self._late, []
        for arrival in (*backlog, point):
            previous.add(arrival)
        self._stretch, self._before = previous, None
        # `_begin` stored this line as ended.
        self._earlier.pop()
        return True

    def _returned(self) -> None:
        for point in self._late:
            self._stretch.add(point)
        self._late = []

    def _begin(self, points: list[Point]) -> None:
        if (model := self._stretch.model(self.axis)) is not None:
            self._earlier = [*self._earlier[-EARLIER + 1 :], model]
        self._stretch, self._late, self._before = _Stretch(self._nominal_ns), [], None
        for point in points:
            self._stretch.add(point)

    @property
    def last_counter(self) -> int:
        """Counter of the latest arrival on the line [frames], or device time [ns]; -1 before the first."""
        return self._stretch.last[0]

    def remembers(self, counter: int) -> bool:
        """Whether arrivals as old as a counter [frames] still belong to the present line."""
        blocks = self._stretch.blocks
        return bool(blocks) and blocks[0].hull[0][0] <= counter

    def line(self) -> tuple[int, int, float] | None:
        """Return (counter, host time [ns], period [ns]) of the present line without a new fit; None before there is
        one.
        """
        return self._stretch.line()

    def model(self) -> ClockModel | None:
        """Return the model of all arrivals so far, or None before two different counters are known."""
        model = self._stretch.model(self.axis)
        if model is None:
            return replace(self._earlier[-1], earlier=tuple(self._earlier[:-1])) if self._earlier else None
        return replace(model, earlier=tuple(self._earlier))


def fit(
    arrival_ns: np.ndarray,
    counter: np.ndarray,
    axis: str = "counter",
    rate: float = 1.0,
    nominal_ns: float | None = None,
) -> ClockModel | None:
    """Fit a whole stream at once.

    Args:
        arrival_ns: Host times of receipt [ns], shape (n,).
        counter: Device counters [frames], or device times [ns], shape (n,); -1 without one.
        axis: Which of the two.
        rate: Seconds that the host's clock shows per real second.
        nominal_ns: As in `EnvelopeFit`.
    """
    running = EnvelopeFit(axis, rate, nominal_ns)
    for arrival, count in zip(np.asarray(arrival_ns).tolist(), np.asarray(counter).tolist(), strict=True):
        running.add(arrival, count)
    running._returned()
    return running.model()
