"""Presses of a small made-up sensor, time-stepped apart from the library."""

import itertools

import numpy as np
from scipy.signal import lfilter

from tacdata.chain import Course, Tool
from tacdata.chain.rows import rows_of

FINE = 200


def course(
    seed=0,
    episodes=24,
    rates=(0.5, 2.0),
    noise=1.0,
    lag=0.0,
    delay=0.0,
    relaxed=0.0,
    play=0.0,
    hold=1.5,
    pulls=True,
    power=1.0,
    friction=0.0,
    recovery=None,
    times=((2.0, 1.0),),
    radii=(4.0,),
    by_radius=0.0,
):
    """Return presses of three channels at two places; sizes in s, s, share, mm.

    What relaxes does so by ``times``, each with its share; under a tool they are longer by its radius over the mean of
    all, to the power ``by_radius``.

    A tool that pulls sticks to the skin; readings grow by a power of load. Friction is a share of load, carried by
    elements that slip beyond loads of their own and come to rest when the tool is off. While the tip leaves, readings
    are late by ``recovery``, as by ``delay`` unless given.
    """
    slips = np.array([0.03, 0.08, 0.2])
    rng = np.random.default_rng(seed)
    tools = rng.permutation(np.arange(episodes) % len(radii)) if len(radii) > 1 else np.zeros(episodes, dtype=int)
    parts, clock, slow = [], 0.0, {}
    for k in range(episodes):
        rate, depth = rng.choice(rates), rng.choice([0.6, 1.0])
        way = (depth + 0.3) / rate
        at = np.cumsum([0, 0.5, way, hold, way, 0.8])
        path = np.array([-0.3, -0.3, depth, depth, -0.3, -0.3])
        time = np.arange(0, at[-1], 1 / FINE)
        tip = np.interp(time, at, path)
        weights = np.array([[1.0, 0.5, 0.2], [0.2, 0.6, 1.0]])[k % 2]
        jitter = 0.002 * rng.normal()
        pressed = np.maximum(followed(tip, play) + jitter, 0.0) ** 1.5
        carried = (1 - friction) * pressed + friction * slid(pressed, slips) if friction else pressed
        load = weights * np.maximum(carried, 0.0)[:, None]
        left = load
        for (t, radius), (tau, share) in itertools.product(enumerate(radii), times):
            own = tau * (radius / np.mean(radii)) ** by_radius
            behind = lagged(load * (t == tools[k]), own, slow.get((t, tau), np.zeros(3)) * np.exp(-1 / own))
            left, slow[t, tau] = left - relaxed * share * behind, behind[-1]
        now = left if pulls else np.maximum(left, 0.0)
        late = lagged(now, lag, np.zeros(3)) if lag > 0 else now
        read = 5000 + 800 * (late if power == 1.0 else np.maximum(late, 0.0) ** power)
        pick = np.arange(rng.integers(6), len(time), 6)
        by = np.where(time[pick] < at[3], delay, delay if recovery is None else recovery)
        before = np.maximum(pick - np.round(by * FINE).astype(int), 0)
        values = np.round(read[before] + noise * rng.normal(size=(len(pick), 3)))
        parts.append((clock, rows_of(time[pick], values, at, np.column_stack([0 * at + k % 2, 0 * at, path]))))
        clock += at[-1] + 1.0
    count = [len(rows.time) for _, rows in parts]
    episode = np.repeat(np.arange(episodes), count)
    return Course(
        time=np.concatenate([begin + rows.time for begin, rows in parts]),
        episode=episode,
        tip=np.concatenate([rows.tip for _, rows in parts]),
        tool=tools[episode],
        readings=np.concatenate([rows.values for _, rows in parts]),
        averaged=np.concatenate([rows.averaged for _, rows in parts]),
        session=np.zeros(episodes, dtype=int),
        site=np.arange(episodes) % 2,
        tools=tuple(Tool(f"ball {k}" if k else "ball", "sphere", r) for k, r in enumerate(radii)),
        names=tuple(f"press {k}" for k in range(episodes)),
        centers=np.array([[-1.0, 0], [0, 0], [1, 0]]),
    )


def lagged(values, lag, before):
    """Return values [any unit], shape (n, channels), after a first-order lag [s] that stood at ``before``."""
    share = 1 / (FINE * lag)
    return lfilter([share], [1, share - 1], values, axis=0, zi=(1 - share) * before[None])[0]


def followed(tip, play):
    """Return the depth of a follower with play [mm], shape (n,)."""
    depth, made = -0.3, []
    for z in tip.tolist():
        depth = min(max(depth, z), z + play)
        made.append(depth)
    return np.array(made)


def slid(pressed, slips):
    """Return the mean load of elements that slip beyond loads of their own and rest in the air, shape (n,)."""
    held, made = np.zeros(len(slips)), []
    for now, before in zip(pressed, [0.0, *pressed[:-1]], strict=True):
        held = np.clip(held + now - before, -slips, slips) if now > 0 else np.zeros(len(slips))
        made.append(held.mean())
    return np.array(made)
