"""Effects of no library: the right answer is unknown, or a set that admits it."""

import numpy as np

from worlds.follow import late
from worlds.hidden import hidden


def outside(stage, group, **more):
    """Enter an effect without a name."""
    return hidden(stage, group, called=(), fitted=True, **more)


@outside("readout", "per channel", most=8)
def telegraph(w, s):
    """Channels jump between two levels at random, every six seconds."""
    for c in range(w.rise.shape[1]):
        flips = np.cumsum(w.rng.random(len(w.rise)) < w.step / 6.0)
        w.rise[:, c] += 12.0 * s * (flips % 2)


@outside("readout", "loading and unloading", most=8)
def cable_pull(w, s):
    """The cable's loop moves the offsets with the height of the carriage, each channel its own way, late."""
    z = w.carriage[:, 2:3]
    w.rise = w.rise + 25 * s * (z - late(z, w, 0.5)) * w.rng.normal(0, 1, w.rise.shape[1])


@outside("skin", "loading and unloading", most=6)
def stick_slip(w, s):
    """Friction lets go in jumps: a saw tooth that differs from press to press."""
    way = np.abs(np.diff(w.pose[:, 2], prepend=w.pose[0, 2])) / 0.13
    phase = np.cumsum(np.where(w.fresh, w.rng.random(len(way)) * 3, way))
    w.load = w.load * (1 + 0.05 * s * ((phase % 1.0) - 0.5) * (w.pose[:, 2] > 0))[:, None]


@outside("skin", "hold time", most=6)
def ageing_creep(w, s):
    """Relaxation that sets in through the session."""
    t = (w.clock / w.clock[-1])[:, None]
    w.load = w.load - 0.15 * s * (np.exp(-1.5 * t) * late(w.load, w, 6.0) * t + t**2 * late(w.load, w, 0.7))


@outside("guide", "depth offset", most=8)
def lost_and_found(w, s):
    """Steps are lost in one stretch and come back by homing."""
    share = w.episode / w.episode.max()
    w.carriage[(share > 0.35) & (share < 0.6), 2] -= 0.05 * s


@outside("guide", "lateral", most=8, needs={"streams": ("tag",)})
def tag_flex(w, s):
    """The tag's holder bends with the carriage's speed: the tag is off, the tip is not."""
    v = np.gradient(w.carriage[:, 2]) / w.step
    v[w.fresh] = 0
    w.tag_error = w.tag_error + 0.08 * s * np.column_stack([np.tanh(v), np.zeros_like(v), 0.5 * np.tanh(v)])


@outside("readout", "clock", most=8)
def moisture_front(w, s):
    """A front of damp moves over the array: channels gain one after the other, and keep it."""
    when = np.linspace(0.1, 0.9, w.rise.shape[1]) * w.clock[-1]
    reached = 1 / (1 + np.exp(-(w.clock[:, None] - when) / (0.03 * w.clock[-1])))
    w.rise = w.rise * (1 + 0.10 * s * reached) + 6 * s * reached


@outside("timing", "lag", most=4)
def scan_order_change(w, s):
    """Half way through, the order in which channels are read turns around."""
    w.scan = w.scan + 0.08 * s * np.where(w.clock > 0.5 * w.clock[-1], -1.0, 1.0)


@outside("skin", "hold time", most=6, needs={"streams": ("temperature",)})
def warm_creep(w, s):
    """Relaxation that is there when it is warm."""
    share = np.clip((w.warm - w.warm.min()) / np.ptp(w.warm), 0, 1)[:, None] ** 2
    w.load = w.load - 0.18 * s * share * late(w.load, w, 2.0)


@outside("readout", "clock", most=8)
def motor_noise(w, s):
    """While motors turn, a beat of their drive is added to all channels, phase by phase."""
    moving = (np.abs(np.diff(w.carriage, axis=0, prepend=w.carriage[:1])).max(axis=1) > 1e-6)[:, None]
    w.rise = w.rise + 8 * s * moving * np.sin(2 * np.pi * 3.3 * w.clock[:, None] + np.arange(w.rise.shape[1]))


@outside("mounting", "depth offset", most=8)
def loose_tool(w, s):
    """The tip slides into its holder under load and is pulled out in the air, half the time."""
    deep = 0.05 * s * (w.rng.random(len(w.presses)) < 0.5)
    for rows, much in zip(w.presses, deep, strict=True):
        w.pose[rows, 2] -= much * np.minimum(1.0, np.maximum.accumulate(np.maximum(w.pose[rows, 2], 0.0)) / 0.4)


@outside("skin", "per channel", most=6)
def torn_protrusion(w, s):
    """Four protrusions carry on loading and hang back while unloading, by their own share."""
    chosen = w.rng.choice(w.load.shape[1] - 1, 4, replace=False)
    leaving = (np.diff(w.pose[:, 2], prepend=w.pose[0, 2]) < 0)[:, None]
    w.load[:, chosen] *= 1 - 0.12 * s * leaving * np.linspace(0.6, 1.0, 4)


@outside("mounting", "depth offset", most=6)
def rocking(w, s):
    """The sensor has three feet and rocks: a tilt that flips with the side that is pressed, late."""
    side = np.tanh(w.pose[:, :1] / 1.0) * (w.pose[:, 2:3] > 0)
    w.pose[:, 2] += 0.05 * s * late(side, w, 0.4)[:, 0]
