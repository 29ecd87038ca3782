"""Effects of a taxel other than its curve. ``w.rise`` holds readings above idle [counts]."""

import numpy as np

from worlds.hidden import hidden


@hidden("taxel", "amplitude", most=6, both=True)
def gain(w, s):
    """All channels read too much."""
    w.rise = w.rise * (1 + 0.12 * s)
    w.tell("gain", e=0.12 * s)


@hidden("taxel", "per channel", most=4, both=True)
def channel_gain(w, s):
    """Half the channels up, half down, by half to whole of a fifth."""
    sign = w.rng.permutation(np.repeat([-1, 1], w.rise.shape[1] // 2))
    w.rise = w.rise * (1 + 0.2 * s * sign * w.rng.uniform(0.5, 1, w.rise.shape[1]))


@hidden("taxel", "depth curvature", most=8)
def saturation(w, s):
    """An amplifier that gives out: hyperbolic tangent."""
    top = w.rise.max() / (0.45 * np.sqrt(s))
    w.rise = top * np.tanh(w.rise / top)


@hidden("taxel", "depth curvature", most=4)
def gap_curvature(w, s):
    """A gap that closes: one over the remaining gap."""
    w.rise = w.rise / (1 - 0.08 * s * w.rise / w.rise.max())


@hidden("taxel", "depth offset", most=6)
def air_gap(w, s):
    """Air under each protrusion: no reading until it is closed, a smooth corner."""
    lost = 0.04 * s * w.rise.max(axis=0) * w.rng.uniform(0.3, 1.0, w.rise.shape[1])
    soft = 0.2 * lost + 1e-9
    w.rise = soft * (np.logaddexp(0.0, (w.rise - lost) / soft) - np.logaddexp(0.0, -lost / soft))


@hidden("taxel", "depth offset", called=("seating_gap", "air_gap"), most=6)
def seating_gap(w, s):
    """The whole skin has a gap to its support and settles under load."""
    lost = 0.02 * s * w.rise.max()
    w.rise = np.where(w.rise > lost, w.rise - lost, 0.08 * w.rise)
