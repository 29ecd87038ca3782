"""Laws of skins and machines, of other forms than the library's. Nothing here imports tacdata."""

import numpy as np


def stroke(rate, depth, speed, hold, begin=0.6, back=None, rest=1.0):
    """Return times [s] at a rate [Hz] and the depth [mm] of one press."""
    knots = np.cumsum([0.0, begin, depth / speed, hold, depth / (back or speed), rest])
    time = np.arange(0.0, knots[-1], 1 / rate)
    return time, np.interp(time, knots, [0.0, 0.0, depth, depth, 0.0, 0.0])


def relaxed(time, load, kernel):
    """Return a load that relaxes: a convolution of its changes with a kernel that falls from 1."""
    change, since = np.diff(load, prepend=0.0), time[:, None] - time[None, :]
    return (np.where(since >= 0, kernel(np.maximum(since, 0.0)), 0.0) * change[None, :]).sum(axis=1)


def power_law(share, alpha, tau=0.08):
    """Return a kernel without a longest time: it goes on falling through all decades."""
    return lambda t: 1 - share + share * (1 + t / tau) ** -alpha


def stretched(share, tau, beta):
    """Return Kohlrausch's kernel."""
    return lambda t: 1 - share + share * np.exp(-((t / tau) ** beta))


def preisach(inputs, width, cells=40):
    """Return the output of relays whose thresholds are apart by about a width (Preisach), inputs from 0 to 1."""
    up, down = np.meshgrid(*[np.linspace(0, 1, cells)] * 2, indexing="ij")
    up, down = up[up >= down], down[up >= down]
    weight, on, made = np.exp(-(((up - down) / width) ** 2)), np.zeros(len(up), bool), []
    for value in inputs:
        on = (on | (value >= up)) & ~(value <= down - 1e-9)
        made.append(weight[on].sum() / weight.sum())
    return np.array(made)


def late(time, depth, going_in, coming_out):
    """Return a depth as it was some time ago: another time while it comes out."""
    first, second = (np.interp(time - by, time, depth) for by in (going_in, coming_out))
    return np.maximum(first, second)


def creeping(time, load, share, slow, slower):
    """Return a load that grows on under constant depth, and comes back more slowly."""
    inner, made = 0.0, []
    for step, value in zip(np.diff(time, prepend=time[0]), load, strict=True):
        inner += (value - inner) * step / (slow if value >= inner else slower)
        made.append(value + share * inner)
    return np.array(made)


def leaking(time, volume, tau):
    """Return the pressure of a chamber that is squeezed and leaks to the room."""
    pressure, made = 0.0, []
    for step, change in zip(np.diff(time, prepend=time[0]), np.diff(volume, prepend=volume[0]), strict=True):
        pressure = pressure * np.exp(-step / tau) + change
        made.append(pressure)
    return np.array(made)


def lugre(time, speed, dry, stick, stiff, stribeck=2.0, inner=20):
    """Return the force of bristles that bend, slip, and hold better at rest [N]."""
    bend, made = 0.0, []
    for step, v in zip(np.diff(time, prepend=time[0]), speed, strict=True):
        most = (dry + (stick - dry) * np.exp(-((v / stribeck) ** 2))) / stiff
        for _ in range(inner):
            bend += (v - abs(v) / most * bend) * step / inner
        made.append(stiff * bend)
    return np.array(made)


def hertz(depth, modulus, radius):
    """Return the force of a sphere on a half space [N]."""
    return 4 / 3 * modulus * np.sqrt(radius) * np.maximum(depth, 0.0) ** 1.5


def peeling(depth, top, modulus, radius, work):
    """Return the force on the way back where the skin sticks: JKR, with a contact that first stays as wide as it is."""
    wide = np.linspace(0.02, np.sqrt(radius * top), 2000)
    below = wide**2 / radius - np.sqrt(2 * np.pi * work * wide / modulus)
    force = 4 * modulus * wide**3 / 3 / radius - np.sqrt(8 * np.pi * work * modulus * wide**3)
    first = int(np.argmin(below))
    pinned = hertz(top, modulus, radius) - 2 * modulus * wide[-1] * (top - depth)
    free = np.interp(depth, below[first:], force[first:], left=0.0)
    return np.where(depth < below[first], 0.0, np.maximum(pinned, free))


def behind_a_frame(machine, law, compliance):
    """Return the force where a frame gives way by so much a force [mm/N]: by bisection, row by row."""
    low, high = np.zeros_like(machine), law(np.maximum(machine, 0.0))
    for _ in range(60):
        middle = (low + high) / 2
        more = law(machine - compliance * middle) > middle
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return (low + high) / 2


def dipole(at, moment):
    """Return the field of a magnet that points along z, at places around it, shape (n, 3) [any unit]."""
    far = np.linalg.norm(at, axis=1, keepdims=True)
    return moment * (3 * at * at[:, 2:] / far**5 - np.array([0, 0, 1.0]) / far**3)
