"""Channels under a layer: response to the load, drift and noise of each."""

from math import exp

import numpy as np
from path import ONLY, STEP

FULL = 0.55
"""Share of a transducer's range that the largest load takes up [1]."""


def _cell(share):
    return 12.0 * (1 / (1 - np.clip(share, 0, 0.8)))


def _chamber(share):
    return 101.3 + 60 * share


def _ink(share):
    return 3000 * share**0.75


def _magnet(share):
    return 900 * (1 / (1 - 0.45 * np.clip(share, 0, 1)) ** 3 - 1)


def _gauge(share):
    return 4.0e4 * (share + 0.2 * share * share)


TRANSDUCERS = {
    "capacitive": (_cell, "pF"),
    "barometric": (_chamber, "kPa"),
    "resistive": (_ink, "counts"),
    "magnetic": (_magnet, "uT"),
    "strain": (_gauge, "counts"),
}
"""Share of the range -> reading, and its unit."""


class Board:
    """Channels on a square grid."""

    def __init__(
        self, rng, channels, kind, step, *, largest=4.0, noise=0.0015, memory=0.6, gain=0.01, wander=0.003, pitch=4.0
    ):
        """Draw channels.

        Args:
            rng: Draws gains, powers and offsets now, and all that shakes later.
            channels: How many.
            kind: One of `TRANSDUCERS`.
            step: Between two levels of a reading [its unit].
            largest: Load that takes up `FULL` of the range [N].
            noise: Of a reading [its range].
            memory: Of noise from row to row [1].
            gain: Spread of a press's own gain; 0.3 of it for each channel alone [1].
            wander: Of offsets from press to press [its range].
            pitch: Of the grid [mm].
        """
        self.rng, self.channels, self.step, self.largest = rng, channels, step, largest
        self.noise, self.memory, self.gain, self.wander = noise, memory, gain, wander
        self.law, self.unit = TRANSDUCERS[kind]
        side = int(np.ceil(np.sqrt(channels)))
        grid = np.array([(i % side, i // side) for i in range(channels)], float)
        self.places = (grid - grid.mean(0)) * pitch  # [mm], shape (channels, 2)
        self.width = pitch * 1.1
        self.gains = 1 + 0.08 * rng.standard_normal(channels)
        self.powers = 1 + 0.06 * rng.standard_normal(channels)
        self.range = float(np.ptp(self.law(np.array([0, FULL]))))
        self.offsets = 0.02 * self.range * rng.standard_normal(channels)
        self.wandered = np.zeros(channels)

    def pressed(self, loads, place=ONLY, lag=0.0, gain=1.0):
        """Return readings without noise, shape (n, channels), and let offsets wander on.

        Args:
            loads: A row a `STEP` [N], shape (n,).
            place: Of the tool [mm].
            lag: Time constant of a low pass behind the transducer [s].
            gain: Of all channels, a number or shape (n,) [1].
        """
        apart = ((self.places - np.array(place)) ** 2).sum(1)
        reach = np.exp(-apart / 2 / self.width**2)
        reach = reach / max(reach.max(), 0.5)
        share = FULL * (np.maximum(loads, 0)[:, None] / self.largest) ** self.powers * reach
        idle = self.law(np.zeros(1))
        common = 1 + self.gain * self.rng.standard_normal()
        own = 1 + 0.3 * self.gain * self.rng.standard_normal(self.channels)
        rise = (self.law(share) - idle) * self.gains * common * own
        reading = rise * np.atleast_1d(gain)[:, None] + idle + self.offsets + self.wandered
        self.wandered = self.wandered * 0.98 + self.wander * self.range * self.rng.standard_normal(self.channels)
        return low_pass(reading, lag) if lag else reading

    def said(self, time, reading, at):
        """Return the logged readings at given times [s]: with noise, drift and levels, shape (rows, channels)."""
        clean = np.stack([np.interp(at, time, reading[:, i]) for i in range(self.channels)], 1)
        kicks = self.rng.standard_normal(clean.shape)
        noise, last = np.empty_like(kicks), self.rng.standard_normal(self.channels)
        for i, kick in enumerate(kicks):
            last = self.memory * last + np.sqrt(1 - self.memory**2) * kick
            noise[i] = last
        seconds = at[-1] - at[0]
        walk = np.cumsum(self.rng.standard_normal(clean.shape), 0) * np.sqrt(max(seconds, 1) / len(at))
        said = clean + self.noise * self.range * noise + walk * self.wander * self.range * 0.05
        return np.round(said / self.step) * self.step


def low_pass(reading, tau):
    """Return readings behind a low pass of first order, a row a `STEP`, shape (n, channels)."""
    share = 1 - exp(-STEP / tau)
    out, last = np.empty_like(reading), reading[0]
    for i, value in enumerate(reading):
        last = last + share * (value - last)
        out[i] = last
    return out
