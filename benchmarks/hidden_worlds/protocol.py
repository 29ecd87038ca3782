"""What is pressed: commanded paths on a fine clock."""

import numpy as np

FINE = 240  # commanded rows a second


def press(depth, speed, hold, rest=0.6, recovery=0.8, clearance=0.35, overshoot=0.0):
    """One press as (seconds, depth) breakpoints."""
    way = depth + overshoot + clearance
    times, depths = [0.0, rest], [-clearance, -clearance]
    times.append(times[-1] + way / speed)
    depths.append(depth + overshoot)
    if overshoot:
        times += [times[-1] + 0.3, times[-1] + 0.3 + overshoot / speed]
        depths += [depth + overshoot, depth]
    times += [times[-1] + hold, times[-1] + hold + (depth + clearance) / speed]
    depths += [depth, -clearance]
    times.append(times[-1] + recovery)
    depths.append(-clearance)
    return np.array(times), np.array(depths)


def rich(rng, episodes=48):
    """Rates, depths, holds, repeats, two radii, sites on and off taxels, overshoots."""
    sites = np.array([[-2.85, -1.25], [0.0, 0.0], [2.4, 1.9], [-0.95, 2.5], [3.8, -2.5], [-3.8, 2.2]])
    made = []
    for _ in range(episodes):
        site = int(rng.integers(len(sites)))
        made.append({
            "x": sites[site][0], "y": sites[site][1], "depth": float(rng.choice([0.4, 0.7, 1.0])),
            "speed": float(rng.choice([0.3, 1.0, 3.0])),
            "hold": float(rng.choice([0.4, 1.5, 8.0], p=[0.5, 0.35, 0.15])),
            "recovery": float(rng.choice([0.8, 6.0], p=[0.8, 0.2])), "tool": int(rng.random() < 0.3),
            "overshoot": 0.25 if rng.random() < 0.15 else 0.0,
        })
    return made


def poor(rng, episodes=24):
    """One rate, one depth, one tool, short holds, three places: what cannot split much."""
    sites = np.array([[-2.85, -1.25], [0.0, 0.0], [2.4, 1.9]])
    return [
        {"x": sites[k % 3][0], "y": sites[k % 3][1], "depth": 0.7, "speed": 1.0, "hold": 0.4, "recovery": 0.8,
         "tool": 0, "overshoot": 0.0}
        for k in range(episodes)
    ]


def path(presses):
    """Fine rows of the whole session: time, episode, x, y, depth, tool."""
    parts, clock = [], 0.0
    for k, p in enumerate(presses):
        t, d = press(p["depth"], p["speed"], p["hold"], recovery=p["recovery"], overshoot=p["overshoot"])
        fine = np.arange(0, t[-1], 1 / FINE)
        n = len(fine)
        parts.append(np.column_stack([
            clock + fine, np.full(n, k), np.full(n, p["x"]), np.full(n, p["y"]), np.interp(fine, t, d),
            np.full(n, p["tool"]),
        ]))
        clock += t[-1] + 2.5  # travel between presses
    return np.concatenate(parts)
