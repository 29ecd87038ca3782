"""Possible true effects of a foreign rig, stepped in time; no form is the library's."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from protocols import STEP


@dataclass
class Rig:
    """State that persists from trial to trial."""

    size: float
    """How strong the effect is, 1 as usual."""
    length: float
    """Length of everything [s]."""
    kept: dict = field(default_factory=dict)


def _still(rig, trial, values):
    return values


@dataclass(frozen=True)
class Effect:
    """One truth: each part takes the rig, the trial and the values that it changes, a row every `STEP`."""

    called: tuple = ()
    """Names that a verdict may rightly give."""
    moved: Callable = _still
    """Commanded depth -> depth reached [mm], shape (n,)."""
    loaded: Callable = lambda rig, trial, depth, load: load
    """Depth reached, loads -> loads, shape (n, channels)."""
    read: Callable = _still
    """Readings over the largest rise, shape (n, channels)."""


def _lag(values, tau, start=None):
    out, last, share = np.empty_like(values), values[0] if start is None else start, STEP / (STEP + tau)
    for i, value in enumerate(values):
        last = last + share * (value - last)
        out[i] = last
    return out


def _clock(rig, trial, rows):
    return (trial.begin + np.arange(rows) * STEP) / rig.length


def _backlash(rig, trial, depth):
    out, last, play = np.empty_like(depth), depth[0], 0.06 * rig.size
    for i, z in enumerate(depth):
        last = min(max(last, z), z + play)
        out[i] = last
    return out


def _compliance(rig, trial, depth):
    return depth - 0.12 * rig.size * (np.maximum(depth, 0.0) / 2.0) ** 1.5


def _relaxation(rig, trial, depth, load):
    """Three terms; the rest of a trial's memory relaxes on between trials."""
    late = np.zeros_like(load)
    for tau, share in ((0.3, 0.3), (2.0, 0.4), (12.0, 0.3)):
        ended, last = rig.kept.get(tau, (trial.begin, np.zeros(load.shape[1])))
        memory = _lag(load, tau, last * np.exp(-(trial.begin - ended) / tau))
        rig.kept[tau] = trial.begin + len(load) * STEP, memory[-1]
        late += share * memory
    return load - 0.15 * rig.size * late


def _friction(rig, trial, depth, load):
    """Bouc-Wen."""
    z, out, d = 0.0, np.empty_like(depth), np.maximum(depth, 0.0)
    for i, (now, step) in enumerate(zip(d, np.diff(d, prepend=d[0]), strict=True)):
        z += step / 0.25 - abs(step) / 0.25 * z
        out[i] = z * now
    return load * (1 + 0.08 * rig.size * (out / np.maximum(d, 0.05) - 1.0))[:, None]


def _softening(rig, trial, depth, load):
    """Damage by the deepest press so far, and a little by every press."""
    most, count = rig.kept.get(trial.site, (0.0, 0))
    top = np.maximum(np.maximum.accumulate(np.maximum(depth, 0.0)), most)
    rig.kept[trial.site] = float(top[-1]), count + 1
    ease = 1 - 0.10 * rig.size * np.tanh((top - np.maximum(depth, 0.0)) / 0.6)
    return load * (ease - 0.02 * rig.size * np.log1p(count) / 3)[:, None]


def _latency(rig, trial, reading):
    late = int(0.08 * rig.size / STEP)
    return np.concatenate([np.repeat(reading[:1], late, axis=0), reading[: len(reading) - late]])


def _smoothing(rig, trial, reading):
    return _lag(_lag(reading, 0.08 * rig.size), 0.08 * rig.size)


def _stairs(rig, trial, reading):
    """Readings lie on levels and leave one only when well beyond it."""
    grid, out = 0.02 * rig.size, np.empty_like(reading)
    level = np.round(reading[0] / grid)
    for i, value in enumerate(reading / grid):
        level = np.where(np.abs(value - level) > 0.9, np.round(value), level)
        out[i] = level * grid
    return out


def _gain_drift(rig, trial, reading):
    return reading * (1 - 0.10 * rig.size * np.sqrt(_clock(rig, trial, len(reading))))[:, None]


def _drift(rig, trial, reading):
    own = np.cos(1.7 * np.arange(reading.shape[1]) + 0.4)
    return reading + 0.08 * rig.size * -np.expm1(-2 * _clock(rig, trial, len(reading)))[:, None] * own


EFFECTS = {
    "nothing": Effect(),
    "backlash": Effect(("backlash",), moved=_backlash),
    "compliance": Effect(("frame_compliance", "carriage_compliance"), moved=_compliance),
    "relaxation": Effect(("relaxation",), loaded=_relaxation),
    "friction": Effect(("hysteresis",), loaded=_friction),
    "softening": Effect(("softening",), loaded=_softening),
    "latency": Effect(("latency",), read=_latency),
    "smoothing": Effect(("low_pass_filter",), read=_smoothing),
    "stairs": Effect(("quantization_hysteresis",), read=_stairs),
    "gain drift": Effect(("gain_drift",), read=_gain_drift),
    "drift": Effect(("drift", "warm_up_drift"), read=_drift),
}
