"""Effects of the electronics on readings above idle [counts]."""

import numpy as np

from worlds import skin
from worlds.follow import late
from worlds.hidden import hidden
from worlds.protocol import FINE


@hidden("readout", "lag", fitted=True, most=6)
def low_pass_filter(w, s):
    """A single-pole filter that runs at its own rate, in the rests too."""
    w.rise = late(w.rise, w, 0.05 * s)
    w.tell("low_pass_filter", tau=0.05 * s)


@hidden("readout", "lateral spread", most=6, both=True)
def crosstalk(w, s):
    """Traces side by side, in the order of numbers."""
    side = np.zeros_like(w.rise)
    side[:, 1:] += w.rise[:, :-1]
    side[:, :-1] += w.rise[:, 1:]
    w.rise = w.rise + 0.025 * s * side
    w.tell("crosstalk", k=0.025 * s)


@hidden("readout", "clock", fitted=True, most=10, both=True)
def drift(w, s):
    """Nearly straight, each channel its own."""
    t = w.clock / w.clock[-1]
    w.rise = w.rise + 20.0 * s * (t + 0.15 * np.sin(3 * t))[:, None] * w.rng.normal(0, 1, w.rise.shape[1])


@hidden("readout", "clock", fitted=True, most=6, both=True)
def gain_drift(w, s):
    """As the root of time."""
    w.rise = w.rise * (1 - 0.08 * s * np.sqrt(w.clock / w.clock[-1]))[:, None]


@hidden("readout", "clock", fitted=True, most=10, called=("warm_up_drift", "drift"), both=True)
def warm_up_drift(w, s):
    """From power-on, two time constants, the same in all channels."""
    t = w.clock
    w.rise = w.rise + (40.0 * s * (0.7 * np.exp(-t / 120.0) + 0.3 * np.exp(-t / 500.0)))[:, None]


@hidden("readout", "hold time", fitted=True, most=8)
def baseline_tracking(w, s):
    """Ten times a second the chip moves its baseline towards the reading."""
    every, share = FINE // 10, 1 - np.exp(-0.02 * s / 10)
    base = np.zeros(w.rise.shape[1])
    out = np.empty_like(w.rise)
    for rows in w.presses:
        base = base + (1 - (1 - share) ** round(w.gap[rows[0]] * 10)) * (w.rise[rows[0]] - base)
        for block in np.split(rows, np.arange(every, len(rows), every)):
            out[block] = w.rise[block] - base
            base = base + share * (w.rise[block[-1]] - base)
    w.rise = out
    w.tell("baseline_tracking", r=0.02 * s)


@hidden("readout", "temperature", fitted=True, most=8, needs={"streams": ("temperature",)}, both=True)
def temperature_offset(w, s):
    """The front end moves with warmth, each channel its own way, slightly bent."""
    t = w.warm - w.warm.mean()
    w.rise = w.rise + 4.0 * s * (t + 0.03 * t**2)[:, None] * w.rng.normal(0, 1, w.rise.shape[1])


@hidden("readout", "depth offset", most=8, both=True)
def proximity(w, s):
    """A conductive tip is felt before it touches: one over the distance to the channel."""
    c = skin.centers()
    aside = np.hypot(w.pose[:, :1] - c[:, 0], w.pose[:, 1:2] - c[:, 1])
    away = np.maximum(-w.pose[:, 2:3], 0.0)
    w.rise = w.rise + 25.0 * s / (1 + np.hypot(aside, away + 0.3) ** 2)


@hidden("readout", "loading and unloading", called=("quantization_hysteresis", "hysteresis"), fitted=True, most=8)
def quantization_hysteresis(w, s):
    """A code is left only when the input is past it by more than a band."""
    band, out = 0.02 * s * w.rise.max(), np.empty_like(w.rise)
    held = w.rise[0].copy()
    for i, now in enumerate(w.rise):
        held = np.minimum(np.maximum(held, now - band), now + band)
        out[i] = held
    w.rise = out
