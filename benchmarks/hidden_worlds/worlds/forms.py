"""The right mechanism in a functional form that a library is unlikely to hold."""

import numpy as np

from worlds.follow import late
from worlds.hidden import hidden


@hidden("skin", "hold time", called=("relaxation",), fitted=True, most=6)
def fractional_relaxation(w, s):
    """A power law of time, by seven branches over five decades."""
    taus = 10.0 ** np.linspace(-2, 3, 7)
    weight = taus**-0.15
    weight /= weight.sum()
    w.load = w.load - 0.16 * s * sum(g * late(w.load, w, tau) for g, tau in zip(weight, taus, strict=True))


@hidden("skin", "hold time", called=("relaxation",), fitted=True, most=6)
def three_branch_relaxation(w, s):
    """Three branches two decades apart, the taxel's dielectric a little behind the skin."""
    w.load = w.load - 0.10 * s * sum(g * late(w.load, w, tau) for g, tau in ((0.4, 0.2), (0.35, 2.0), (0.25, 20.0)))


@hidden("skin", "hold time", called=("relaxation",), fitted=True, most=6)
def leaving_relaxation(w, s):
    """Two branches a factor 20 apart; the tool leaves the skin before it would pull."""
    left = w.load - 0.10 * s * sum(g * late(w.load, w, tau) for g, tau in ((0.5, 0.4), (0.5, 8.0)))
    w.load = np.where(left[:, -1:] > 0, left, 0.0)


@hidden("skin", "loading and unloading", called=("hysteresis",), fitted=True, most=6)
def dahl_hysteresis(w, s):
    """Dahl friction on depth: z' = d' (1 - sgn(d') z)^2 over 0.08 mm."""
    out = np.zeros(len(w.load))
    for rows in w.presses:
        z, before = 0.0, max(w.pose[rows[0], 2], 0.0)
        for i, now in zip(rows, np.maximum(w.pose[rows, 2], 0.0).tolist(), strict=True):
            step = (now - before) / 0.08
            z = min(max(z + step * (1 - np.sign(step) * z) ** 2, -1.0), 1.0)
            out[i], before = z, now
    w.load = w.load * (1 + 0.04 * s * (out - 1))[:, None]


@hidden("skin", "loading and unloading", called=("softening",), fitted=True, most=6)
def recovering_softening(w, s):
    """Softening by the largest depth at a place that comes back over ten minutes."""
    most, when = np.zeros(w.site.max() + 1), np.zeros(w.site.max() + 1)
    ease, depth = np.empty(len(w.load)), np.maximum(w.pose[:, 2], 0.0)
    for rows in w.presses:
        k = w.site[rows[0]]
        left = most[k] * np.exp(-(w.clock[rows[0]] - when[k]) / 600.0)
        reached = np.maximum(np.maximum.accumulate(depth[rows]), left)
        ease[rows] = 1 - 0.09 * s * np.tanh((reached - depth[rows]) / 0.25)
        most[k], when[k] = reached[-1], w.clock[rows[-1]]
    w.load = w.load * ease[:, None]


@hidden("readout", "lag", called=("low_pass_filter",), fitted=True, most=6)
def two_pole_filter(w, s):
    """Two poles, one half as slow."""
    w.rise = late(late(w.rise, w, 0.035 * s), w, 0.018 * s)


@hidden("guide", "loading and unloading", called=("backlash",), fitted=True, most=8)
def elastic_backlash(w, s):
    """Play whose flanks give way: three plays side by side."""
    z = w.carriage[:, 2].copy()
    parts = []
    for b in (0.02 * s, 0.04 * s, 0.06 * s):
        out, at = z.copy(), z[0]
        for i, here in enumerate(z.tolist()):
            at = here if here > at else max(at, min(at, here + b)) if at - here <= b else here + b
            out[i] = at
        parts.append(out)
    w.carriage[:, 2] = np.mean(parts, axis=0)


@hidden("taxel", "depth curvature", called=("saturation",), most=8)
def clipping(w, s):
    """A hard ceiling, a little soft."""
    top, soft = w.rise.max() * (1 - 0.12 * s), 0.04 * s * w.rise.max()
    w.rise = w.rise - soft * np.logaddexp(0.0, (w.rise - top) / soft)


@hidden("readout", "clock", called=("drift",), fitted=True, most=10)
def stepwise_drift(w, s):
    """Offsets move in a few steps that nothing else explains, each channel by a share of its own."""
    level = np.zeros(len(w.clock))
    for at in np.sort(w.rng.uniform(0, 1, 5)):
        level[w.clock > at * w.clock[-1]] += 0.2
    w.rise = w.rise + 22.0 * s * level[:, None] * w.rng.normal(0, 1, w.rise.shape[1])


@hidden("readout", "lateral spread", called=("crosstalk",), most=6)
def row_crosstalk(w, s):
    """Channels of a row share a line: each takes a little of all the others in it."""
    rows = np.arange(w.rise.shape[1]) // 6
    w.rise = w.rise + 0.015 * s * w.rise @ ((rows[:, None] == rows) & ~np.eye(len(rows), dtype=bool))


@hidden("mounting", "depth offset", called=("thermal_growth",), fitted=True, most=8)
def wavy_growth(w, s):
    """The column follows the room: up, and half way back."""
    t = w.clock / w.clock[-1]
    w.pose[:, 2] += 0.06 * s * (np.sin(2.2 * t) - 0.3 * np.sin(4.0 * t))
