"""Presses added to a world: as they are recommended, or random ones of equal length."""

import numpy as np
from worlds import protocol, world

SPEEDS = (0.15, 6.0)
"""As recommended presses may have them [mm/s]."""
LEAST = 0.8
"""The least time in the air after a press [s]."""
KEYS = ("time", "episode", "readings", "path_time", "path_episode", "path", "force", "tag", "temperature")
"""Arrays with a row a reading, or a row of the path."""


def added(press):
    """Return a press as a world runs it."""
    asked = {k: press[k] for k in ("x", "y", "depth", "speed", "hold", "overshoot")}
    asked |= {"strokes": int(press.get("strokes", 0)), "stroke": press.get("stroke", 0.0), "on_rows": True}
    recovery = max(press["recovery"], LEAST)
    return {**asked, "tool": press["tool"], "recovery": recovery, "from": np.array([protocol.SIDE, 0.0])}


def length(press):
    """Return how long a press takes [s]."""
    return float(protocol.breakpoints(added(press))[-1, 0])


def alike(rng, press, before):
    """Return a random press that takes as long as another: place, tool, depth, rate and hold are drawn.

    Args:
        rng: Where it is drawn from.
        press: How long it takes.
        before: Presses of the world: their places, tools and depths are those to draw from.
    """
    wanted = length(press)
    deepest = max(p["depth"] + p["overshoot"] for p in before)
    while True:
        at = before[rng.integers(len(before))]
        drawn = {
            "x": float(at["x"]),
            "y": float(at["y"]),
            "tool": int(at["tool"]),
            "overshoot": 0.0,
            "depth": float(rng.uniform(0.3, 1.0) * deepest),
            "hold": 0.0,
            "recovery": LEAST,
            "speed": float(np.exp(rng.uniform(*np.log(SPEEDS)))),
        }
        rest = wanted - length(drawn)
        if rest >= 0:
            share = rng.uniform()
            return {**drawn, "hold": share * rest, "recovery": LEAST + (1 - share) * rest}


def recordings(case, more):
    """Return a world's recordings: those of its case as they were, and those of presses added after them."""
    first, _, table = world.make(case.seed, case.effects, **case.settings)
    if table:
        raise ValueError(f"{case.name}: its table is wrong, which no press mends")
    if not more:
        return first
    every, _, _ = world.make(case.seed, case.effects, **case.settings, more=tuple(added(p) for p in more))
    count = len(first["tool"])
    made = dict(every)
    for key in KEYS:
        if key in every:
            number = every["path_episode" if key.startswith("path") else "episode"]
            made[key] = np.concatenate([first[key], every[key][number >= count]])
    return made
