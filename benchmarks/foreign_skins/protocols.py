"""How other labs press: courses of commanded depth, a thousand steps a second."""

from dataclasses import dataclass

import numpy as np

STEP = 0.001


@dataclass(frozen=True)
class Trial:
    """One file."""

    site: int
    depth: np.ndarray
    """Commanded depth at every step [mm], negative in the air."""
    begin: float
    """[s]"""


def _ramps(corners, speed):
    """Return depth along straight ramps between corners; a pair (depth, seconds) waits there."""
    made, last = [], corners[0][0]
    for depth, wait in corners:
        steps = max(int(abs(depth - last) / speed / STEP), 1)
        made += [np.linspace(last, depth, steps, endpoint=False), np.full(int(wait / STEP), float(depth))]
        last = depth
    course = np.concatenate(made)
    width = 30  # drives accelerate
    return np.convolve(np.pad(course, (width, width), mode="edge"), np.ones(width) / width, "same")[width:-width]


def presses(rng):
    """Return single presses at four sites: three speeds, two depths, two repeats."""
    order = [(s, v, d) for _ in range(2) for s in range(4) for v in (0.5, 1.5, 5.0) for d in (1.0, 2.0)]
    rng.shuffle(order)
    found, now = [], 0.0
    for site, speed, depth in order:
        site = int(site)
        found.append(Trial(site, _ramps([(-0.5, 0.7), (depth, 3.0), (-0.5, 1.5)], speed), now))
        now += len(found[-1].depth) * STEP + rng.uniform(2, 6)
    return found


def cycles(rng):
    """Return three recordings of twelve slow sine cycles at one site."""
    found, now = [], 0.0
    for seconds in (6.0, 12.0, 6.0):
        t = np.arange(0, 12 * seconds, STEP)
        found.append(Trial(0, 0.9 - 1.2 * np.cos(2 * np.pi * t / seconds), now))
        now += len(t) * STEP + 120.0
    return found


def staircase(rng):
    """Return stairs up and down with a wait on every step, to different tops, at two sites."""
    found, now = [], 0.0
    for k in range(16):
        top, count = (1.2, 2.0)[k % 2], 8
        up = [(top * i / count, 1.0) for i in range(1, count + 1)]
        corners = [(-0.3, 1.0), *up, *reversed(up[:-1]), (-0.3, 1.5)]
        found.append(Trial(k // 2 % 2, _ramps(corners, (1.0, 3.0)[k // 4 % 2]), now))
        now += len(found[-1].depth) * STEP + rng.uniform(3, 8)
    return found


PROTOCOLS = {"presses": presses, "cycles": cycles, "staircase": staircase}
