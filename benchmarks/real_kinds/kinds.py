"""Kinds of recordings that other labs publish: protocol, quantities read, and true effects.

Nothing here imports tacdata. Laws are integrated in time and have other forms than the library's.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

STEP = 0.01
"""Rows lie so far apart [s]."""
MEMORY, FRICTION, DELAY, KINEMATICS = ("memory of the skin", "friction and play", "delay and filtering", "kinematics")


@dataclass(frozen=True)
class Trial:
    """One press, or one loop."""

    depth: np.ndarray
    """Of the machine, every `STEP` [mm]."""
    begin: float
    """[s]"""
    place: int = 0
    specimen: str = "a"


@dataclass(frozen=True)
class Kind:
    """One kind of recordings."""

    mechanisms: tuple
    """Names that a verdict may rightly give alone."""
    families: tuple
    """Families that it may rightly give."""
    trials: Callable
    """From a generator to presses."""
    read: Callable
    """From press, state kept between presses, strength and laws to tip and readings, a row every `STEP`."""
    channels: int = 1
    rate: float = 25.0
    """Readings a second [Hz]."""
    steep: tuple = (1.1, 1.7)
    """Least and largest exponent of a channel's rise with depth."""
    unit: str = "counts"
    gauge: bool = False
    """Whether a laser looks at the tip."""
    force: bool = False
    """Whether there is a load cell below."""
    fair: tuple = field(default=())
    """Further names that are fair in a set."""


def ramp(corners, speeds):
    """Return depth along straight ways: corners are (depth, wait); one speed, or one a way."""
    made, (last, wait) = [], corners[0]
    made.append(np.full(int(wait / STEP), float(last)))
    speeds = np.broadcast_to(speeds, len(corners) - 1)
    for (depth, wait), speed in zip(corners[1:], speeds, strict=True):
        steps = max(int(abs(depth - last) / speed / STEP), 2)
        made += [np.linspace(last, depth, steps, endpoint=False), np.full(int(wait / STEP), float(depth))]
        last = depth
    path, width = np.concatenate(made), 7
    return np.convolve(np.pad(path, width // 2, mode="edge"), np.ones(width) / width, "valid")


def in_turn(rng, paths, pause=(4.0, 15.0)):
    """Return presses one after the other; each path comes with place and specimen."""
    found, now = [], 0.0
    for depth, place, specimen in paths:
        found.append(Trial(depth, now, place, specimen))
        now += len(depth) * STEP + rng.uniform(*pause)
    return found


def late(values, tau, start=0.0):
    """Return a first-order lag of values, shape (n, channels), that begins at a start."""
    share = STEP / (STEP + tau)
    first = np.broadcast_to(np.asarray(start, float), values.shape[1:]) * (1 - share)
    return lfilter([share], [1, share - 1], values, axis=0, zi=first[None])[0]


def remembered(trial, kept, load, spectrum):
    """Return the memory of a load: a weighted sum of lags that go on between presses."""
    total = np.zeros_like(load)
    for tau, weight in spectrum:
        ended, last = kept.get((trial.place, tau), (trial.begin, np.zeros(load.shape[1])))
        own = late(load, tau, last * np.exp(-(trial.begin - ended) / tau))
        kept[trial.place, tau] = trial.begin + len(load) * STEP, own[-1]
        total += weight * own
    return total


def relaxing(much, spectrum):
    """Return a reader whose loads relax by a share along a spectrum."""

    def read(trial, kept, size, law):
        load = law(trial, trial.depth)
        return trial.depth, load - much * size * remembered(trial, kept, load, spectrum)

    return read


def creeping(trial, kept, size, law):
    """Readings go on under load, and come back slowly."""
    load = law(trial, trial.depth)
    return trial.depth, load + 0.14 * size * remembered(trial, kept, load, ((0.8, 0.3), (6.0, 0.7)))


def late_and_creeping(trial, kept, size, law):
    """A delay of 0.2 s down and 0.5 s up, creep, and slow recovery."""
    load = law(trial, trial.depth)
    load = load + 0.12 * size * remembered(trial, kept, load, ((1.5, 0.4), (9.0, 0.6)))
    first, second = (np.concatenate([np.repeat(load[:1], n, axis=0), load[:-n]]) for n in (20, 50))
    return trial.depth, np.where(np.abs(second) > np.abs(first), second, first)


def complying(trial, kept, size, law):
    """The frame gives way under the load."""
    grid = np.linspace(min(trial.depth.min(), 0.0), trial.depth.max(), 400)
    load = law(trial, grid)[:, 0]
    tip = np.interp(trial.depth, grid + 0.13 * size * np.sign(load) * np.abs(load) ** 0.9, grid)
    return tip, law(trial, tip)


def rubbing(trial, kept, size, law):
    """Elements of a network slide (Dahl), so that loads hang back."""
    z, out, depth = -1.0, np.empty(len(trial.depth)), np.maximum(trial.depth, 0.0)
    for k, step in enumerate(np.diff(depth, prepend=depth[0])):
        z += step / 0.22 - abs(step) / 0.22 * z
        z = -1.0 if depth[k] <= 0 else z
        out[k] = z
    return trial.depth, law(trial, trial.depth) * (1 + 0.07 * size * (out - 1))[:, None]


def dry(trial, kept, size, law):
    """A piston's seal: a force against the motion, larger at rest (Stribeck), and a spring."""
    seal = np.array([0.0])
    speed, out, stretch = np.gradient(trial.depth) / STEP, np.empty(len(trial.depth)), float(kept.get("z", 0.0))
    for k, v in enumerate(speed):
        limit = 1 + 0.25 * np.exp(-abs(v) / 0.8)
        stretch = np.clip(stretch + v * STEP / 0.05, -limit, limit)
        out[k] = stretch
    kept["z"] = stretch
    return trial.depth, law(trial, trial.depth) + seal + 0.09 * size * out[:, None]


def softening(trial, kept, size, law):
    """Damage by the deepest press so far, and a little by every press."""
    most, count = kept.get(trial.place, (0.0, 0))
    depth = np.maximum(trial.depth, 0.0)
    top = np.maximum(np.maximum.accumulate(depth), most)
    kept[trial.place] = float(top[-1]), count + 1
    ease = 1 - 0.16 * size * np.tanh((top - depth) / 0.8) - 0.012 * size * np.log1p(count)
    return trial.depth, law(trial, trial.depth) * ease[:, None]


def late_only(trial, kept, size, law):
    """A delay at one rate: it looks like play."""
    load, n = law(trial, trial.depth), max(int(0.12 * size / STEP), 1)
    return trial.depth, np.concatenate([np.repeat(load[:1], n, axis=0), load[:-n]])


def plain(trial, kept, size, law):
    """Nothing."""
    return trial.depth, law(trial, trial.depth)


def presses(speeds, depths, hold, places=1, repeats=2, specimens=("a",), rest=1.5):
    """Return a protocol of single presses."""

    def made(rng):
        order = [
            (v, d, p, s)
            for _ in range(repeats)
            for p in range(places)
            for s in specimens
            for v in speeds
            for d in depths
        ]
        rng.shuffle(order)
        order.sort(key=lambda o: o[3])
        return in_turn(
            rng, [(ramp([(-0.3, 0.4), (float(d), hold), (-0.3, rest)], float(v)), int(p), s) for v, d, p, s in order]
        )

    return made


def stretches(hold):
    """Return a protocol of loops from zero at several rates and stretches, of long strokes, and some holds."""

    def made(rng):
        paths = []
        for _ in range(3):
            for top in (27.0, 54.0, 80.2):
                paths += [(ramp([(0.0, 0.3), (top, 0.0), (0.0, 0.6)], v), 0, "a") for v in (4.0, 12.0, 40.0)]
        paths += [(ramp([(0.0, 0.3), (top, hold), (0.0, 0.6)], 40.0), 0, "a") for top in (27.0, 54.0, 80.2) if hold]
        return in_turn(rng, paths, (60.0, 90.0))

    return made


def staircases(rng):
    """Return stairs up and down with waits, to two tops."""
    paths = []
    for k in range(12):
        top, count = (1.0, 1.6)[k % 2], 6
        up = [(top * i / count, 2.0) for i in range(1, count + 1)]
        paths.append((ramp([(-0.2, 1.0), *up, *reversed(up[:-1]), (-0.2, 3.0)], (0.8, 3.0)[k // 2 % 2]), k // 4, "a"))
    return in_turn(rng, paths)


def strokes(rng):
    """Return strokes of a piston that never leaves its spring: three speeds, three ways."""
    order = [(v, w) for _ in range(3) for v in (2.0, 8.0, 25.0) for w in (6.0, 10.0, 14.0)]
    rng.shuffle(order)
    return in_turn(rng, [(ramp([(0.5, 0.5), (float(w), 0.5), (0.5, 0.5)], float(v)), 0, "a") for v, w in order])


def sines(rng):
    """Return cycles of growing depth, three sets of ten, at one place."""
    paths = []
    for _ in range(3):
        for k in range(10):
            t = np.arange(0, 8.0, STEP)
            paths.append(((0.8 + 0.12 * k) * (1 - np.cos(2 * np.pi * t / 8.0)) / 2 * 1.5 - 0.1, 0, "a"))
    return in_turn(rng, paths, (0.0, 0.02))


SLOW = ((0.15, 0.25), (1.0, 0.25), (8.0, 0.25), (60.0, 0.25))
KINDS = {
    "frame and materials": Kind(
        ("frame_compliance",),
        (KINEMATICS,),
        presses((0.5, 2.0), (1.0, 1.6), 1.0, specimens=("eco30", "ds10", "ds20", "ds30", "vytaflex")),
        complying,
        1,
        unit="N",
        gauge=True,
    ),
    "delay, creep and recovery": Kind(
        ("latency", "creep"),
        (DELAY, MEMORY),
        presses((0.6, 1.5, 4.0), (1.0, 1.6), 3.0, places=2, repeats=2, rest=5.0),
        late_and_creeping,
        8,
        unit="counts",
    ),
    "capacitive staircase": Kind(("creep",), (MEMORY,), staircases, creeping, 2, unit="pF"),
    "rates and stretches": Kind(
        ("relaxation",), (MEMORY,), stretches(30.0), relaxing(0.55, SLOW), 1, unit="N", fair=("viscosity",)
    ),
    "loops at three rates": Kind(
        ("relaxation", "viscosity"), (MEMORY,), stretches(0.0), relaxing(0.55, SLOW), 1, unit="N"
    ),
    "capacitance beside force": Kind(
        ("hysteresis",),
        (FRICTION,),
        presses((0.5, 1.5, 5.0), (0.8, 1.5), 1.0, repeats=4),
        rubbing,
        1,
        unit="pF",
        force=True,
    ),
    "barometric": Kind(
        ("relaxation",),
        (MEMORY,),
        presses((0.5, 2.0, 6.0), (1.0, 2.0), 4.0, places=2, rest=3.0),
        relaxing(0.18, SLOW[:3]),
        5,
        unit="hPa",
    ),
    "magnetic": Kind(("softening",), (MEMORY,), sines, softening, 12, unit="uT"),
    "piston": Kind(("dry_friction",), (FRICTION,), strokes, dry, 1, 50.0, (0.9, 1.2), unit="N"),
    "decoy for backlash": Kind(
        ("latency",),
        (DELAY,),
        presses((1.0,), (0.8, 1.6), 1.0, places=2, repeats=6),
        late_only,
        3,
        fair=("low_pass_filter", "servo_lag", "backlash", "hysteresis"),
    ),
    "nothing": Kind((), (), presses((0.5, 1.5, 5.0), (1.0, 1.8), 2.0, places=2), plain, 4),
}
