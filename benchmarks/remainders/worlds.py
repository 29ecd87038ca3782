"""Presses of a small foreign skin that holds one known thing and something of no library.

Skin, protocol and effects are those of `foreign_skins`: nothing here imports tacdata. The remainder is scaled to a
share of the gap: of the part that no response without memory, fitted to each place, could take up.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "foreign_skins"))

import hidden
import protocols
from hidden import EFFECTS, Rig
from protocols import Trial, _ramps
from skins import Skin

STEP = hidden.STEP = protocols.STEP = 0.004
"""Coarser than theirs: many worlds are made [s]."""

CHANNELS, RATE = 3, 16.0
NOISE, GAIN, WANDER, TOUCH = 0.002, 0.005, 0.001, 0.005
"""Noise of a reading, a press's own gain, steps of offsets [largest rise]; errors of contact [mm]."""
LONGEST = 60.0


def viscous(rig, trial, depth, load):
    """Loads rise with the root of the rate of pressing."""
    v = np.gradient(depth) / STEP
    return load * (1 + 0.06 * rig.size * np.sign(v) * np.sqrt(np.abs(v)))[:, None]


def late_release(rig, trial, depth, load):
    """The first second of letting go: loads fall at once by a share that comes back."""
    leaving = np.gradient(depth) < 0
    begin = np.flatnonzero(leaving & ~np.roll(leaving, 1))
    since = np.full(len(depth), np.inf)
    for k in begin:
        since[k:] = np.arange(len(depth) - k) * STEP
    return load * (1 - 0.08 * rig.size * np.exp(-since / 0.7) * (depth > 0))[:, None]


def stick_slip(rig, trial, depth, load):
    """Friction lets go in jumps that differ from press to press."""
    way = np.abs(np.diff(depth, prepend=depth[0])) / 0.2
    phase = np.cumsum(way) + np.random.default_rng(int(1e3 * trial.begin)).uniform()
    return load * (1 + 0.05 * rig.size * ((phase % 1.0) - 0.5) * (depth > 0))[:, None]


def ageing(rig, trial, depth, load):
    """Relaxation that sets in through the session."""
    share, out, last = trial.begin / rig.length, np.empty_like(load), load[0]
    for i, now in enumerate(load):
        last = last + STEP / 3.0 * (now - last)
        out[i] = last
    return load - 0.2 * rig.size * share**2 * out


def cable(rig, trial, depth, load):
    """The cable's loop moves offsets with the height of the carriage, each channel its own way."""
    own = np.cos(2.3 * np.arange(load.shape[1]) + 1.0)
    return load + 0.02 * rig.size * np.tanh(np.gradient(depth) / STEP)[:, None] * own


def rate_filter(rig, trial, depth, load):
    """A filter that is slow while the tip moves slowly."""
    speed, out, last = np.abs(np.gradient(depth)) / STEP, np.empty_like(load), load[0]
    for i, now in enumerate(load):
        last = last + min(STEP / (0.05 * rig.size / max(speed[i], 0.3)), 1.0) * (now - last)
        out[i] = last
    return out


REMAINDERS = {f.__name__: f for f in (viscous, late_release, cable, ageing, rate_filter, stick_slip)}
FAMILIES = {
    "viscous": ("memory of the skin",),
    "late_release": ("memory of the skin", "friction and play"),
    "stick_slip": ("friction and play",),
    "ageing": ("memory of the skin",),
    "cable": (),
    "rate_filter": ("delay and filtering", "memory of the skin"),
}
"""Families that a verdict may rightly give a remainder that is the only effect."""
KINDS = ("relaxation", "friction", "softening", "latency", "smoothing", "backlash", "stairs", "gain drift", "drift")


def trials(rng):
    """Return 24 presses at two places: three speeds, two depths."""
    order = [(s, v, d) for _ in range(2) for s in range(2) for v in (0.7, 1.8, 4.5) for d in (1.2, 2.0)]
    rng.shuffle(order)
    found, now = [], 0.0
    for site, speed, depth in order:
        found.append(Trial(int(site), _ramps([(-0.4, 0.6), (depth, 2.0), (-0.4, 1.2)], speed), now))
        now += len(found[-1].depth) * STEP + rng.uniform(2, 6)
    return found


def made(seed, kind, remainder, share):
    """Return one world: times, readings, path and place of each press, and the share that the remainder holds.

    Args:
        seed: Of everything.
        kind: One of `EFFECTS`, "nothing" among them.
        remainder: One of `REMAINDERS`, or "".
        share: Of the gap; 1 where nothing else is there.
    """
    rng = np.random.default_rng([seed, *map(ord, kind + remainder)])
    every = trials(rng)
    skin = Skin(CHANNELS, RATE, (1.1, 1.8), 2e-4)
    loads, length = skin.laws(rng, 2), every[-1].begin + 30.0
    size = rng.uniform(0.7, 1.5)
    clean = _read(every, loads, EFFECTS["nothing"], None, size, 0.0, length)
    with_it = _read(every, loads, EFFECTS[kind], None, size, 0.0, length)
    strength = 0.0
    if remainder:
        beside = _read(every, loads, EFFECTS["nothing"], REMAINDERS[remainder], size, 1.0, length)
        own, other = (_gap(every, clean, v) for v in (with_it, beside))
        strength = 1.0 if kind == "nothing" else float(np.sqrt(share / (1 - share) * own / max(other, 1e-30)))
        strength = min(strength, LONGEST)
    values = _read(every, loads, EFFECTS[kind], REMAINDERS.get(remainder), size, strength, length, rng)
    wander, presses = np.zeros(CHANNELS), []
    for trial, value in zip(every, values, strict=True):
        at = np.cumsum(rng.normal(1 / RATE, 0.03 / RATE, int(len(value) * STEP * RATE) - 2)) / STEP
        wander = wander + rng.normal(0, WANDER, CHANNELS)
        noise = rng.normal(0, NOISE, (len(at), CHANNELS))
        for i in range(1, len(noise)):
            noise[i] += 0.4 * noise[i - 1]
        said = np.stack([np.interp(at, np.arange(len(value)), c) for c in value.T], axis=1)
        said = said * (1 + rng.normal(0, GAIN)) + wander + noise
        path = trial.depth[::3]
        when = trial.begin + 3 * STEP * np.arange(len(path))
        presses.append((trial.begin + at * STEP, np.round(said / skin.levels), when, path, trial.site))
    return presses, strength


def _read(every, loads, effect, remainder, size, strength, length, rng=None):
    """Return the readings of each press, a row every `STEP`."""
    rig, other, read = Rig(size, length), Rig(strength, length), []
    for trial in every:
        tip = effect.moved(rig, trial, trial.depth)
        touch = 0.0 if rng is None else rng.normal(0, TOUCH)
        load = effect.loaded(rig, trial, tip, loads(trial.site, tip + touch, 2.0))
        if remainder is not None:
            load = remainder(other, trial, trial.depth, load)
        read.append(effect.read(rig, trial, load))
    return read


def _gap(every, before, after):
    """Return the energy of a change beyond a polynomial in depth at each place, with an offset a press."""
    energy = 0.0
    for site in (0, 1):
        own = [k for k, t in enumerate(every) if t.site == site]
        depth = np.concatenate([np.maximum(every[k].depth[::10], 0) for k in own])
        change = np.concatenate([(after[k] - before[k])[::10] for k in own])
        press = np.repeat(np.arange(len(own)), [len(every[k].depth[::10]) for k in own])
        columns = np.column_stack([depth[:, None] ** np.arange(1, 6), press[:, None] == np.arange(len(own))])
        left = change - columns @ np.linalg.lstsq(columns, change, rcond=None)[0]
        energy += float(np.square(left).sum())
    return energy
