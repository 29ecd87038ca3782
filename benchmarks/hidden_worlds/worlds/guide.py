"""Errors of the guide's motion: a tag on the carriage sees them."""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from worlds.hidden import hidden


@hidden("guide", "loading and unloading", fitted=True, most=8)
def backlash(w, s):
    """A nut with clearance: nothing moves until the play is through."""
    b, out, at = 0.04 * s, w.carriage[:, 2].copy(), w.carriage[0, 2]
    for i, z in enumerate(w.carriage[:, 2].tolist()):
        if z > at:
            at = z
        elif at - z > b:
            at = z + b
        out[i] = at
    w.carriage[:, 2] = out
    w.tell("backlash", b=b)


@hidden("guide", "lateral", most=8)
def lateral_backlash(w, s):
    """The same, sideways: its position depends on the side it came from."""
    b = 0.06 * s
    for axis in (0, 1):
        at, out = w.carriage[0, axis], w.carriage[:, axis].copy()
        for i, x in enumerate(w.carriage[:, axis].tolist()):
            at = min(max(at, x - b / 2), x + b / 2)
            out[i] = at
        w.carriage[:, axis] = out
    w.tell("lateral_backlash", b=b)


@hidden("guide", "depth offset", fitted=True, most=8, both=True)
def lost_steps(w, s):
    """Steps are lost once, from a moment on."""
    w.carriage[w.episode > 0.45 * w.episode.max(), 2] -= 0.05 * s
    w.tell("lost_steps", dz=-0.05 * s)


@hidden("guide", "lag", fitted=True, most=4)
def servo_lag(w, s):
    """Second-order follower, damping 0.9, exact between rows for a command that moves straight."""
    omega = 2 / (0.06 * s)
    top, bottom, _ = cont2discrete(([omega**2], [1, 1.8 * omega, omega**2]), w.step, method="foh")
    for rows in w.presses:
        z = w.carriage[rows, 2]
        w.carriage[rows, 2] = z[0] + lfilter(top[0], bottom, z - z[0])


@hidden("guide", "amplitude", most=10, both=True)
def travel_scale(w, s):
    """Wrong steps a millimetre on all axes."""
    w.carriage *= 1 + 0.02 * s
    w.tell("travel_scale", k=0.02 * s)


@hidden("guide", "lateral", most=8, both=True)
def skew(w, s):
    """The axes lean: x goes along as y goes, and is as much shorter as a parallelogram has it."""
    g = 0.025 * s
    w.carriage[:, 0] += np.tan(np.arctan(g)) * w.carriage[:, 1]
    w.carriage[:, 1] *= np.cos(np.arctan(g))
    w.tell("skew", g=g)


@hidden("guide", "depth offset", most=8, both=True)
def screw_error(w, s):
    """The height wobbles once a turn of a 0.8 mm screw, with a second harmonic."""
    phase = w.rng.uniform(0, 2 * np.pi)
    turn = 2 * np.pi * w.carriage[:, 2] / 0.8 + phase
    w.carriage[:, 2] += 0.015 * s * (np.sin(turn) - np.sin(phase) + 0.15 * (np.sin(2 * turn) - np.sin(2 * phase)))


@hidden("guide", "depth offset", most=8, fitted=True, needs={"sessions": 4}, both=True)
def session_zero(w, s):
    """Every homing ends a little elsewhere."""
    off = 0.04 * s * w.rng.normal(size=w.session.max() + 1)
    w.carriage[:, 2] += (off - off.mean())[w.session[w.episode]]
