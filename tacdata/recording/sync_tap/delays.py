"""Measures the constant latency of each stream, from a few quick touches.

Arrivals alone do not show a link's minimum latency (`clock_model`). A touch does. Slow touches show which reading
belongs to which depth, since a latency shifts little there. In quick ones the same curve appears shifted by the latency
times the speed. Only loading is used, since a relaxing skin unloads along another curve.

A camera sees the carriage: its tag follows the height of the guide, later by the camera's latency.

The result is the latency against the commanded path as the reader dates it, on which labels rest. Its uncertainty is a
jackknife over the touches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares, minimize_scalar

from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.episode import TagStream
from tacdata.recording.files.reader import Recording
from tacdata.recording.motion.move_times import AnchoredMove

RANGE = (-0.05, 0.30)
"""Range of latencies that are searched [s]."""
ABOVE = 0.1
"""Height above the skin where the curve of a touch begins [mm]; more than the error of a registration."""
KNOT = 0.06
"""Spacing of the curve's knots [mm]."""
SMOOTH = 0.3
"""Weight of the curve's third differences relative to a sample [1]."""
HELD = 0.03
"""Time at depth that still counts as loading [s]; little of the skin has relaxed by then."""
BASELINE = 0.3
"""Time before a touch over which its baseline is taken [s]."""
LEAST_ANSWER = 20.0
"""Minimum answer to the touches for an estimate [times the noise]."""
LEAST_TOUCHES = 3
"""Minimum number of quick touches for an estimate [count]."""
LEAST_VIEWS = 30
"""Minimum number of poses for an estimate of a camera's latency [count]."""
LEAST_SURE = 0.02
"""Largest uncertainty of a camera's latency that is accepted [s]."""
LEAST_WAY = 1.0
"""Minimum travel of the tag for an estimate of a camera's latency [mm]."""


@dataclass(frozen=True)
class SyncTap:
    """Result of a sync tap."""

    latencies: dict[str, StreamLatency]
    """Latency of each stream that could be measured: "taxels", "camera NAME"."""
    remarks: tuple[str, ...]
    """Why others could not be measured, as sentences."""

    @property
    def words(self) -> tuple[str, ...]:
        """One line per stream, for a person."""
        lines = (
            f"sync tap: {name} {latency.latency_ns / 1e6:.1f} ms late, known to {latency.uncertainty_ns / 1e6:.1f} ms"
            for name, latency in self.latencies.items()
        )
        return (*lines, *(f"sync tap: {remark}" for remark in self.remarks))


def measure(recording: Recording) -> SyncTap:
    """Measure the latencies of all streams in the recording of a sync tap (`motion.sync_tap`)."""
    results = {"taxels": taxel_latency(recording)}
    results |= {f"camera {tags.camera}": camera_latency(recording, tags) for tags in recording.episode.tags}
    latencies = {name: result for name, result in results.items() if isinstance(result, StreamLatency)}
    return SyncTap(latencies, tuple(f"{name}: {r}" for name, r in results.items() if isinstance(r, str)))


@dataclass(frozen=True)
class _Touch:
    """The loading of one touch."""

    move: AnchoredMove
    time: np.ndarray
    """Sample times without the unknown latency, since the move's start [s]."""
    signal: np.ndarray
    """Answer of all channels, weighted [times the noise]."""

    def depth(self, delay: float, origin: float) -> np.ndarray:
        """Commanded depth [mm] below ``origin`` (machine height [mm]) at the touch's samples."""
        way = self.move.profile.distance(self.time - delay)
        share = way / self.move.profile.length
        start, target = self.move.command.start[2], self.move.command.target[2]
        return origin - (start + share * (target - start))

    @property
    def speed(self) -> float:
        return self.move.profile.peak


def taxel_latency(recording: Recording) -> StreamLatency | str:
    """Return the taxel stream's latency, or why it cannot be measured."""
    episode = recording.episode
    moves = [m for m in recording.moves if m.command.phase == "press" and m.profile.length]
    if len(moves) < LEAST_TOUCHES + 1:
        return f"{len(moves)} touches, {LEAST_TOUCHES + 1} or more are needed"
    # The target is the touch's depth below the skin, which gives the skin's machine height.
    origin = float(moves[0].command.target[2]) + episode.press.depth
    signal, answer = _signal(episode.taxels.sample_ns, episode.taxels.counts, moves)
    if answer < LEAST_ANSWER:
        return f"the touches are answered by {answer:.0f} times the noise only; touch deeper or nearer to a taxel"
    touches = [_cut(move, episode.taxels.sample_ns, signal) for move in moves]
    # Quick touches are ten times as fast: the geometric mean separates the two kinds.
    middle = np.sqrt(min(t.speed for t in touches) * max(t.speed for t in touches))
    slow, quick = [t for t in touches if t.speed < middle], [t for t in touches if t.speed >= middle]
    if not slow or len(quick) < LEAST_TOUCHES:
        return f"{len(slow)} slow and {len(quick)} quick touches, 1 and {LEAST_TOUCHES} are needed"
    delay = _match(slow, quick, origin, _coarse(quick, origin))
    estimates = [_match(slow, quick[:k] + quick[k + 1 :], origin, delay) for k in range(len(quick))]
    n = len(quick)
    # Jackknife over the quick touches.
    spread = float(np.sqrt((n - 1) / n * np.sum((np.array(estimates) - np.mean(estimates)) ** 2)))
    clock = recording.clocks.get("taxels")
    line = clock.uncertainty_ns if clock else 0.0
    return StreamLatency(round(delay * 1e9), round(float(np.hypot(spread * 1e9, line))))


def _signal(sample_ns: np.ndarray, counts: np.ndarray, moves: list[AnchoredMove]) -> tuple[np.ndarray, float]:
    """Return the channels' weighted sum in units of its noise, shape (n,), and its answer to the touches."""
    idle = (sample_ns < moves[0].start_ns) & np.isfinite(counts).all(axis=1)
    bad = ~np.isfinite(counts).all(axis=0)
    counts = np.where(bad, 0.0, counts)
    if idle.sum() < 5:
        idle = sample_ns < moves[0].end_ns
    noise = np.maximum(np.diff(counts[idle], axis=0).std(axis=0) / np.sqrt(2), 0.3)
    baseline = np.median(counts[idle], axis=0)
    answers = []
    for move in moves:
        mask = (sample_ns > move.end_ns) & (sample_ns < move.end_ns + round(RANGE[1] * 1e9))
        if mask.any():
            answers.append(counts[mask].max(axis=0, initial=-np.inf) - baseline)
    # Matched filter: channels count by answer over variance.
    weight = np.median(answers, axis=0) / noise**2 if answers else np.zeros(counts.shape[1])
    weight = np.where(bad | (weight < 0), 0.0, weight)
    scale = max(float(np.sqrt(np.sum((weight * noise) ** 2))), 1e-12)
    strongest = float(np.median(answers, axis=0) @ weight / scale) if answers else 0.0
    return (counts - baseline) @ weight / scale, strongest


def _cut(move: AnchoredMove, sample_ns: np.ndarray, signal: np.ndarray) -> _Touch:
    mask = (sample_ns > move.start_ns - round(BASELINE * 1e9)) & (sample_ns < move.start_ns + round(RANGE[0] * 1e9))
    inside = (sample_ns > move.start_ns + round(RANGE[0] * 1e9)) & (sample_ns < move.end_ns + round(RANGE[1] * 1e9))
    base = float(np.median(signal[mask])) if mask.any() else 0.0
    return _Touch(move, (sample_ns[inside] - move.start_ns) / 1e9, signal[inside] - base)


def _coarse(quick: list[_Touch], origin: float) -> float:
    """Return the latency at which depth and signal agree best [s]."""
    delays = np.arange(RANGE[0], RANGE[1], 0.004)
    signal = np.concatenate([t.signal for t in quick])
    likeness = [
        np.corrcoef(np.concatenate([np.maximum(t.depth(float(d), origin), 0.0) for t in quick]), signal)[0, 1]
        for d in delays
    ]
    return float(delays[int(np.nanargmax(likeness))])


def _loading(touch: _Touch, delay: float) -> np.ndarray:
    return (touch.time - delay >= 0) & (touch.time - delay <= touch.move.profile.duration + HELD)


def _match(slow: list[_Touch], quick: list[_Touch], origin: float, delay: float) -> float:
    """Return the latency [s] at which quick touches follow the slow ones' curve."""
    for _ in range(6):
        # Slow touches give the signal over depth, as a delay costs them little depth. Quick ones follow the same curve
        # when shifted rightly.
        curve = _curve(slow, origin, delay)
        inside = [_loading(touch, delay) for touch in quick]
        times = [_Touch(t.move, t.time[i], t.signal[i]) for t, i in zip(quick, inside, strict=True)]
        signal = np.concatenate([t.signal for t in times])

        def residual(values: np.ndarray, times=times, signal=signal, curve=curve) -> np.ndarray:
            depth = np.concatenate([t.depth(float(values[0]), origin) for t in times])
            return values[1] * curve(depth) - signal

        scale = 0.05 * np.abs(signal).max() + 3.0
        # A free factor: at ten times the speed the skin is stiffer.
        fitted = least_squares(residual, [delay, 1.0], loss="soft_l1", f_scale=scale, x_scale=[1e-3, 0.1])
        change, delay = abs(float(fitted.x[0]) - delay), float(fitted.x[0])
        if change < 2e-5:
            break
    return delay


def _curve(slow: list[_Touch], origin: float, delay: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the signal as a smooth function of depth [mm], zero above the skin (P-spline, Eilers and Marx 1996)."""
    depth = np.concatenate([t.depth(delay, origin)[_loading(t, delay)] for t in slow])
    signal = np.concatenate([t.signal[_loading(t, delay)] for t in slow])
    low, deepest = -ABOVE - KNOT, float(depth.max())
    inner = np.arange(low, deepest + KNOT, KNOT)
    knots = np.concatenate([[inner[0]] * 2, inner, [inner[-1]] * 2])
    rows = depth >= low
    table = BSpline.design_matrix(depth[rows], knots, 2).toarray()
    roughness = SMOOTH * np.diff(np.eye(table.shape[1]), 3, axis=0)
    # The first coefficients are held near 0, as nothing answers above the skin.
    still = 10.0 * np.eye(table.shape[1])[:2]
    system = np.vstack([table, roughness, still])
    values = np.concatenate([signal[rows], np.zeros(len(roughness) + len(still))])
    spline = BSpline(knots, np.linalg.lstsq(system, values, rcond=None)[0], 2)
    slope = float(spline.derivative()(deepest))

    def curve(at: np.ndarray) -> np.ndarray:
        # Quick touches may go deeper than slow ones by the delay; the curve goes on straight.
        beyond = np.maximum(at - deepest, 0.0) * slope
        return np.where(at < low, 0.0, spline(np.clip(at, low, deepest)) + beyond)

    return curve


def camera_latency(recording: Recording, tags: TagStream) -> StreamLatency | str:
    """Return a camera's latency from its tag's motion, or why it cannot be measured."""
    mask = tags.faces > 0
    if mask.sum() < LEAST_VIEWS:
        return f"the tag was seen {mask.sum()} times, {LEAST_VIEWS} or more are needed"
    episode, time, place = recording.episode, tags.sample_ns[mask], tags.position[mask] * 1e3
    jumps = np.abs(place - np.median(place, axis=0)).max(axis=1) < 50.0  # a mirrored face is no motion [mm]
    time, place = time[jumps], place[jumps]
    covered = (time > episode.tip_ns[0]) & (time < episode.tip_ns[-1] + round(RANGE[1] * 1e9))
    time, place = time[covered], place[covered]
    if len(time) < LEAST_VIEWS:
        return f"the tag was seen {len(time)} times during the motion, {LEAST_VIEWS} or more are needed"

    def misfit(delay: float, rows: np.ndarray) -> float:
        path = episode.tip_at(time[rows] - round(delay * 1e9))
        # An affine map from guide to camera, so that the camera's pose need not be known.
        table = np.column_stack([path, np.ones(len(path))])
        fitted, *_ = np.linalg.lstsq(table, place[rows], rcond=None)
        deviation = np.linalg.norm(table @ fitted - place[rows], axis=1)
        # An outlier counts as three median residuals at most.
        return float(np.minimum(deviation**2, 9 * np.median(deviation) ** 2 + 1e-12).sum())

    def best(rows: np.ndarray) -> float:
        delays = np.arange(RANGE[0], RANGE[1], 0.005)
        at = delays[int(np.argmin([misfit(float(d), rows) for d in delays]))]
        fine = minimize_scalar(
            lambda d: misfit(float(d), rows), bounds=(at - 0.01, at + 0.01), method="bounded", options={"xatol": 2e-5}
        )
        return float(fine.x)

    if np.ptp(episode.tip_at(time), axis=0).max() < LEAST_WAY:
        return f"the guide moved less than {LEAST_WAY:g} mm while the tag was seen"
    estimate = best(np.ones(len(time), bool))
    # Jackknife over consecutive eighths: neighbouring images share their errors.
    parts = np.arange(len(time)) * 8 // len(time)
    replicates = np.array([best(parts != part) for part in range(8)])
    spread = float(np.sqrt(7 / 8 * np.sum((replicates - replicates.mean()) ** 2)))
    # A minimum at the edge of the search is no estimate.
    if spread > LEAST_SURE or not RANGE[0] + 0.006 < estimate < RANGE[1] - 0.006:
        return "the tag's motion does not show the delay; let the tag be larger in the image, or the host less busy"
    return StreamLatency(round(estimate * 1e9), round(spread * 1e9))
