"""Shapes by which a faulty machine differs from a healthy one, each a curve over the press in the readings' unit."""

from dataclasses import dataclass, replace

import numpy as np

from tacdata.reference.conditions import PressKind

STILL = 0.08
"""Below this share of the fastest speed a tip counts as still [1]."""
TURN = 0.25
"""At this share of the fastest speed friction is nearly all there [1]."""
SMOOTH = 1
"""Points on either side over which speeds and slopes are averaged."""
MEMORIES = (0.15, 0.5)
"""Time constants of memory, as shares of the press [1]."""
LAGGING = ("low_pass_filter", "latency")
"""Mechanisms with a length in time."""
FLAT = 0.02
"""A curve that spans less than this share of the base's range is no shape [1]."""
AGAINST = "while it moves, against the motion"
TYPICAL, TYPICAL_LAG, TYPICAL_SHIFT = 0.3, 0.02, 0.03
"""Sizes that would not surprise: shares of the base's range, of the press's duration, of its depth [1]."""


@dataclass(frozen=True)
class Shape:
    """One curve of a mechanism."""

    mechanism: str
    """A mechanism's name, as in `tacdata.effects`."""
    form: str
    """Which form of it."""
    unit: str
    """Unit of its size; "reading" is the readings' unit."""
    curves: np.ndarray
    """Change of the readings for a size of 1 [the source's unit], shape (t, channels)."""
    typical: np.ndarray
    """Size that would not surprise, as a standard deviation [its unit], shape (channels,)."""


def shapes(condition: PressKind, lags: dict[str, np.ndarray]) -> list[Shape]:
    """Return all shapes of a condition; those that it does not excite are 0.

    Args:
        condition: The condition.
        lags: Lengths to try of each mechanism of `LAGGING` [s].
    """
    time, base = condition.time, condition.base
    speed = _smooth(np.gradient(condition.depth, time))
    fastest = max(float(np.abs(speed).max()), 1e-12)
    way = np.tanh(speed / (TURN * fastest))
    moving = np.tanh((speed / (TURN * fastest)) ** 2)
    # A press begins where the one before ended, at either end of the way.
    start = float(condition.depth[0])
    inward = float(np.sign(condition.depth[np.argmax(np.abs(condition.depth - start))] - start)) or 1.0
    last = _last_way(speed / fastest, inward)
    ones = np.ones(base.shape[1])
    slope = _slope(condition.depth, base, speed / fastest)
    baseline = base[np.argsort(np.abs(condition.depth - start), kind="stable")[: max(len(time) // 20, 1)]].mean(axis=0)
    span, size = float(time[-1] - time[0]), condition.range
    typical = {
        "reading": TYPICAL * size,
        "1": TYPICAL * ones,
        "s": TYPICAL_LAG * span * ones,
        "mm": TYPICAL_SHIFT * float(np.ptp(condition.depth)) * ones,
    }
    # A response holds friction at rest; an effort has it only while the drive moves.
    friction = [
        *([] if condition.effort else [("held at rest", last)]),
        *([] if condition.effort is False else [(AGAINST, way), ("while it moves, either way", moving)]),
    ]
    entries: list[tuple[str, str, str, np.ndarray]] = [
        *(("dry_friction", form, "reading", curve[:, None] * ones) for form, curve in friction),
        ("gain", "of the readings", "1", base - baseline),
        ("z_offset", "of the depth", "mm", slope),
        ("backlash", "of the drive on its way out", "mm", slope * np.where(last == inward, 0.0, -last)[:, None]),
        ("backlash", "of the drive on its way in", "mm", slope * np.where(last == inward, -last, 0.0)[:, None]),
        ("backlash", "of the drive, half on either way", "mm", slope * -0.5 * last[:, None]),
    ]
    for share in MEMORIES:
        entries.append(("relaxation", f"over {share * span:.2g} s", "1", base - _lagged(base, time, share * span)))
    for name in LAGGING:
        for lag in lags[name].tolist():
            late = np.stack([np.interp(time - lag, time, column) for column in base.T], axis=1)
            late = _lagged(base, time, lag) if name == "low_pass_filter" else late
            entries.append((name, f"near {lag:.2g} s", "s", (late - base) / lag))
    # Noise alone, subtracted from itself, would be a gain of -1.
    quiet = np.where(condition.reliable, 1.0, 0.0)
    entries = [(*entry[:3], entry[3] * (1.0 if entry[0] == "dry_friction" else quiet)) for entry in entries]
    return [_excited(Shape(*entry, typical[entry[2]]), size) for entry in entries]


def _excited(shape: Shape, size: np.ndarray) -> Shape:
    """Return a shape without the channels in which a typical size would not show."""
    is_visible = np.ptp(shape.curves, axis=0) * shape.typical > FLAT * size
    return replace(shape, curves=np.where(is_visible, shape.curves, 0.0))


def _smooth(values: np.ndarray) -> np.ndarray:
    width = 2 * SMOOTH + 1
    padded = np.pad(values, SMOOTH, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _last_way(speed: np.ndarray, inward: float) -> np.ndarray:
    """Return the direction of the last motion, 1 to more depth, shape (t,); at first that of the press before."""
    moving = np.abs(speed) > STILL
    last = np.maximum.accumulate(np.where(moving, np.arange(len(speed)), -1))
    return np.where(last < 0, -inward, np.sign(speed[last]))


def _slope(depth: np.ndarray, base: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the change of the base with depth [the source's unit/mm], shape (t, channels): way in and out apart.

    At rest it is the mean of both ways there; a parabola for each way follows no overshoot of the speed's changes.
    """
    slopes, depths = np.zeros_like(base), depth - depth.min()
    for side in (speed > STILL, speed < -STILL):
        rows = np.flatnonzero(side)
        if len(rows) < 6:
            continue
        # Without the ends of each way, where the speed changes.
        inner = rows[len(rows) // 10 : len(rows) - len(rows) // 10]
        for k in range(base.shape[1]):
            fit = np.polynomial.Polynomial.fit(depths[inner], base[inner, k], 3)
            slope = fit.deriv()(np.clip(depths, depths[inner].min(), depths[inner].max()))
            slopes[side, k] = slope[side]
            still = np.abs(speed) <= STILL
            slopes[still, k] += 0.5 * slope[still]
    return slopes


def _lagged(base: np.ndarray, time: np.ndarray, constant: float) -> np.ndarray:
    """Return the base through a first-order lag; the press repeats, so it begins with its own end."""
    step = np.diff(time, prepend=2 * time[0] - time[1])
    value, response = base[0].copy(), np.empty_like(base)
    for _ in range(2):
        for k in range(len(base)):
            value = value + (base[k] - value) * (1 - np.exp(-step[k] / constant))
            response[k] = value
    return response
