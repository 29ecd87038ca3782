"""Protocols: commanded paths on a fine clock."""

import numpy as np

FINE = 240  # commanded rows a second
SITES = np.array([[-2.85, -1.25], [0.0, 0.0], [2.4, 1.9], [-0.95, 2.5], [3.8, -2.5], [-3.8, 2.2]])  # mm
SIDE = 1.2  # mm, how far aside a press is approached from
PAUSE = 2.5  # s, travel between presses
REST = 1200.0  # s, between sessions
STOP = 0.05  # s, pause of the guide where it turns in a stroke


def breakpoints(p):
    """Return one press as times [s] and x, y, depth [mm] between which it moves straight.

    Presses that are added may have `strokes`, each up by `stroke` and back, and corners `on_rows` of the fine clock.
    """
    clearance = p.get("clearance", 0.35)
    x, y, top = p["x"], p["y"], p["depth"] + p["overshoot"]
    points = [(0.0, x - p["from"][0], y - p["from"][1], -clearance), (0.25, x, y, -clearance)]

    def on(seconds, depth):
        points.append((points[-1][0] + seconds, x, y, depth))

    on(0.35, -clearance)
    on((top + clearance) / p["speed"], top)
    if p["overshoot"]:
        on(0.3, top)
        on(p["overshoot"] / p["speed"], p["depth"])
    for _ in range(p.get("strokes", 0)):
        for depth in (p["depth"] - p["stroke"], p["depth"]):
            on(STOP, points[-1][3])
            on(p["stroke"] / p["speed"], depth)
    on(p["hold"], p["depth"])
    on((p["depth"] + clearance) / p["speed"], -clearance)
    on(p["recovery"], -clearance)
    found = np.array(points)
    if p.get("on_rows"):
        found[:, 0] = np.round(found[:, 0] * FINE) / FINE
    return found


def rich(rng, episodes):
    """Rates, depths, holds, repeats, two radii, places on and off taxels, overshoots, four sides of approach."""
    made = []
    for _ in range(episodes):
        site = SITES[rng.integers(len(SITES))]
        made.append(
            {
                "x": site[0],
                "y": site[1],
                "depth": float(rng.choice([0.4, 0.7, 1.0])),
                "speed": float(rng.choice([0.3, 1.0, 3.0])),
                "hold": float(rng.choice([0.4, 1.5, 8.0], p=[0.5, 0.35, 0.15])),
                "recovery": float(rng.choice([0.8, 6.0], p=[0.8, 0.2])),
                "tool": int(rng.random() < 0.3),
                "overshoot": 0.25 if rng.random() < 0.15 else 0.0,
                "from": SIDE * _side(rng),
            }
        )
    return made


def poor(rng, episodes):
    """One rate, one depth, one tool, short holds, three places, one side of approach."""
    return [
        {
            "x": SITES[k % 3][0],
            "y": SITES[k % 3][1],
            "depth": 0.7,
            "speed": 1.0,
            "hold": 0.4,
            "recovery": 0.8,
            "tool": 0,
            "overshoot": 0.0,
            "from": np.array([SIDE, 0.0]),
        }
        for k in range(episodes)
    ]


def one_rate(rng, episodes):
    """Rich but for the rate."""
    return [{**p, "speed": 1.0} for p in rich(rng, episodes)]


def no_holds(rng, episodes):
    """Rich but for holds and rests."""
    return [{**p, "hold": 0.2, "recovery": 0.8, "overshoot": 0.0} for p in rich(rng, episodes)]


def one_site(rng, episodes):
    """Rich at one place with one tool."""
    return [{**p, "x": 0.0, "y": 0.0, "tool": 0} for p in rich(rng, episodes)]


KNOWN = {f.__name__: f for f in (rich, poor, one_rate, no_holds, one_site)}


def _side(rng):
    angle = rng.integers(4) * np.pi / 2
    return np.round([np.cos(angle), np.sin(angle)])


def path(presses, sessions):
    """Return fine rows: time [s], episode, x, y, depth [mm], tool; and the session of each episode."""
    parts, clock = [], 0.0
    session = np.arange(len(presses)) * sessions // len(presses)
    for k, p in enumerate(presses):
        points = breakpoints(p)
        if k and session[k] != session[k - 1]:
            clock += REST
        fine = np.arange(0, points[-1, 0], 1 / FINE)
        at = [np.interp(fine, points[:, 0], points[:, axis]) for axis in (1, 2, 3)]
        parts.append(np.column_stack([clock + fine, np.full(len(fine), k), *at, np.full(len(fine), p["tool"])]))
        clock += points[-1, 0] + PAUSE
    return np.concatenate(parts), session
