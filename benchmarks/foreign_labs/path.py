"""How a tool is moved: holds and ramps in a row, and the protocols that labs make of them."""

import numpy as np

STEP = 0.002
"""Between two rows of everything that is stepped in time [s]."""
HIGH = -1.0
"""Depth at which every run begins [mm]; negative in the air."""
ROUNDED = 0.03
"""Over which a drive rounds the corners of its path [s]."""
ONLY = (0, 0)
"""The place of labs that press at one place [mm]."""


def course(moves):
    """Return times [s] and depths [mm], shape (n,), a row every `STEP`.

    Args:
        moves: ("to", depth [mm], speed [mm/s]) or ("hold", seconds), one after the other.
    """
    depth, parts = HIGH, [np.array([HIGH])]
    for kind, *how in moves:
        if kind == "hold":
            parts.append(np.full(max(1, int(how[0] / STEP)), depth))
        else:
            target, speed = how
            steps = max(2, int(abs(target - depth) / speed / STEP))
            parts.append(np.linspace(depth, target, steps + 1)[1:])
            depth = target
    depths = _rounded(np.concatenate(parts))
    return np.arange(len(depths)) * STEP, depths


def _rounded(depths):
    width = max(1, int(ROUNDED / STEP))
    padded = np.concatenate([np.full(width, depths[0]), depths, np.full(width, depths[-1])])
    return np.convolve(padded, np.ones(width) / width, "same")[width:-width]


def presses(rng, count, depths, speeds, hold=1.0, idle=1.0, drawn=True):
    """Return single presses at one place: a list of (moves, place).

    Args:
        rng: Draws depth, speed and hold of every press, in this order.
        count: How many.
        depths: Least and largest depth if they are drawn; else the depths that take turns [mm].
        speeds: One of these for every press [mm/s].
        hold: At the depth, or several of which one is drawn [s].
        idle: In the air before and after [s].
        drawn: Whether depths are drawn.
    """
    made = []
    for k in range(count):
        depth = rng.uniform(*depths) if drawn else depths[k % len(depths)]
        speed = speeds[rng.integers(len(speeds))]
        wait = max(hold if np.isscalar(hold) else rng.choice(hold), 0.01)
        moves = [("hold", idle), ("to", depth, speed), ("hold", wait), ("to", HIGH, speed), ("hold", idle)]
        made.append((moves, ONLY))
    return made


def cycles(depths, speeds, repeats, hold=0.0, first=2.0):
    """Return moves: cycles from 0.5 mm in the air to every depth [mm] at every speed [mm/s].

    Args:
        depths: In turn [mm].
        speeds: All depths at the first, then all at the next [mm/s].
        repeats: Cycles a depth and speed; then a wait of a second.
        hold: At either end of every stroke [s].
        first: Before the first stroke [s].
    """
    wait = [("hold", hold)] if hold else []
    moves = [("hold", first)]
    for speed in speeds:
        for depth in depths:
            moves += [("to", depth, speed), *wait, ("to", -0.5, speed), *wait] * repeats
            moves.append(("hold", 1.0))
    return moves


def stairs(top, step, dwell, speed):
    """Return moves: stairs down to a depth and up again [mm], a dwell [s] on every step, one speed [mm/s]."""
    count = round(top / step)
    moves = [("hold", 1.5), ("to", 0.0, speed)]
    for number in [*range(1, count + 1), *reversed(range(count))]:
        moves += [("to", number * step, speed), ("hold", dwell)]
    return [*moves, ("to", HIGH, speed), ("hold", 1.0)]
