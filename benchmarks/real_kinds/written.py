"""A set of recordings as files of another lab: one CSV, and a mapping as its owner would write it from the pages."""

import json

import numpy as np
from kinds import KINDS, STEP
from shapes import FILE, POINTS

NOISE, MEMORY, GAIN, WANDER, TOUCH, ENCODER = 0.003, 0.4, 0.008, 0.002, 0.004, 0.0005
"""Noise of a reading, its autocorrelation, a press's own gain, steps of offsets [largest rise]; errors of contact and
of a position [stroke]."""
REMAINDERS = {"real loop": (0, 4), "real bend": (2, 5), "real touch": (3, 4), "real texture": (5, 2, 4)}
"""Shapes of `shapes.csv` of which a remainder is made. (1: an episode's gain is no remainder.)"""
STRONGEST, ALONE = 40.0, 0.006
"""A remainder is no larger than so many of its shapes; alone it is so large (root mean square) [largest rise]."""


def direction(depth):
    """Return which way the tip goes, 0 down and 1 up; at rest as before, and changing within some readings."""
    step = np.sign(np.round(np.gradient(depth), 6))
    last = np.maximum.accumulate(np.where(step != 0, np.arange(len(step)), 0))
    up = (step[last] < 0).astype(float)
    return np.convolve(np.pad(up, 5, mode="edge"), np.ones(11) / 11, "valid")


def remainder(trial, deepest, weights, shapes):
    """Return a real skin's residual at this depth on this way, shape (n, channels)."""
    at, up = np.linspace(0, 1, POINTS), direction(trial.depth)
    share = np.clip(trial.depth / deepest, 0, 1)
    ways = [np.stack([np.interp(share, at, s[k * POINTS : (k + 1) * POINTS]) for s in shapes], 1) for k in (0, 1)]
    return (ways[0] * (1 - up)[:, None] + ways[1] * up[:, None]) @ weights


def gap(trials, change):
    """Return the energy of a change beyond a polynomial in depth of each place and specimen, with offsets."""
    energy, groups = 0.0, sorted({(t.place, t.specimen) for t in trials})
    for group in groups:
        own = [k for k, t in enumerate(trials) if (t.place, t.specimen) == group]
        depth = np.concatenate([np.maximum(trials[k].depth[::5], 0) for k in own])
        depth = depth / max(float(depth.max()), 1e-9)
        press = np.repeat(np.arange(len(own)), [len(trials[k].depth[::5]) for k in own])
        columns = np.column_stack([depth[:, None] ** np.arange(1, 6), press[:, None] == np.arange(len(own))])
        values = np.concatenate([change[k][::5] for k in own])
        energy += float(np.square(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]).sum())
    return energy


def laws_of(rng, kind, trials):
    """Return the function from press and depth to readings without memory, and the largest depth [mm]."""
    deepest = max(float(t.depth.max()) for t in trials)
    groups = {group: k for k, group in enumerate(dict.fromkeys((t.place, t.specimen) for t in trials))}
    shape = (len(groups), kind.channels)
    power, bend = rng.uniform(*kind.steep, shape), rng.uniform(0.0, 0.4, shape)
    size = rng.uniform(0.3, 1.0, shape) * np.where(rng.uniform(size=shape) < 0.25, -1, 1)
    if kind.channels == 1:
        size = np.geomspace(0.25, 1.0, len(groups))[:, None]

    def law(trial, depth):
        k, part = groups[trial.place, trial.specimen], np.maximum(depth, 0.0)[:, None] / deepest
        return size[k] * part ** power[k] * (1 + bend[k] * part) / (1 + bend[k])

    return law, deepest


def made(name, share, which, seed):
    """Return a set: its trials, tip and readings of each (over the largest rise), and the strength of its true effect.

    Args:
        name: One of `KINDS`.
        share: Of the gap that is a remainder; 1: nothing else is there.
        which: One of `REMAINDERS`; empty for none.
        seed: Of everything.
    """
    kind, rng = KINDS[name], np.random.default_rng([seed, *map(ord, name + which)])
    trials = kind.trials(rng)
    law, deepest = laws_of(rng, kind, trials)
    size, kept = rng.uniform(0.7, 1.4), {}
    if share == 1:
        each = [(t.depth, law(t, t.depth)) for t in trials]
    else:
        each = [kind.read(t, kept, size, law) for t in trials]
    own = gap(trials, [read - law(t, t.depth) for t, (_, read) in zip(trials, each, strict=True)])
    strength = 0.0
    if which:
        shapes = np.loadtxt(FILE, delimiter=",")[list(REMAINDERS[which])]
        weights = rng.normal(0.5, 0.6, (len(shapes), kind.channels)) * np.array([1.0, 0.5, 0.5])[: len(shapes), None]
        rest = [remainder(t, deepest, weights, shapes) for t in trials]
        sizes = [(1 + rng.normal(0, 0.15)) * np.sqrt(t.depth.max() / deepest) for t in trials]
        rest = [r * size for r, size in zip(rest, sizes, strict=True)]
        alone = ALONE**2 * kind.channels * sum(len(t.depth) / 5 for t in trials)
        wanted = share / (1 - share) * own if share < 1 else alone
        strength = min(float(np.sqrt(wanted / max(gap(trials, rest), 1e-30))), STRONGEST)
        each = [(tip, read + strength * r) for (tip, read), r in zip(each, rest, strict=True)]
    return kind, trials, each, {"size": size, "strength": strength}


def write(folder, name, share, which, seed):
    """Write CSV and mapping of a set."""
    kind, trials, each, told = made(name, share, which, seed)
    rng = np.random.default_rng([seed, 99])
    stroke = max(float(np.ptp(t.depth)) for t in trials)
    wander, parts = np.zeros(kind.channels), []
    for number, (trial, (tip, read)) in enumerate(zip(trials, each, strict=True)):
        at = np.cumsum(rng.normal(1 / kind.rate, 0.02 / kind.rate, int(len(tip) * STEP * kind.rate) - 2)) / STEP
        wander = wander + rng.normal(0, WANDER, kind.channels)
        noise = rng.normal(0, NOISE, (len(at), kind.channels))
        for k in range(1, len(noise)):
            noise[k] += MEMORY * noise[k - 1]
        slope = np.gradient(read, axis=0) / np.maximum(np.abs(np.gradient(trial.depth)), 1e-4)[:, None]
        read = read + np.clip(slope, -2 / stroke, 2 / stroke) * rng.normal(0, TOUCH * stroke)
        told_at = [np.interp(at, np.arange(len(tip)), c) for c in (read * (1 + rng.normal(0, GAIN))).T]
        values = 1000 * (np.stack(told_at, axis=1) + wander + noise)
        depth, true = (np.interp(at, np.arange(len(tip)), v) for v in (trial.depth, tip))
        depth, true = (v + rng.normal(0, ENCODER * stroke, len(at)) for v in (depth, true))
        columns = {
            "trial": np.full(len(at), number),
            "t": trial.begin + at * STEP,
            "x": np.full(len(at), 6.0 * trial.place),
            "depth": depth,
        }
        if kind.gauge:
            columns["laser"] = true
        if kind.force:
            columns["load"] = 9 * np.interp(at, np.arange(len(tip)), read[:, 0]) + rng.normal(0, 0.01, len(at))
        columns |= {f"s{k + 1}": np.round(v, 2) for k, v in enumerate(values.T)}
        specimen = np.full(len(at), trial.specimen)
        parts.append((columns, specimen))
    folder.mkdir(parents=True)
    names = [*parts[0][0], "material"]
    with (folder / "data.csv").open("w") as file:
        file.write(",".join(names) + "\n")
        for columns, specimen in parts:
            cells = zip(*(np.char.mod("%.5f", c) for c in columns.values()), specimen, strict=True)
            file.writelines(",".join(row) + "\n" for row in cells)
    mapping = {
        "version": "1.3",
        "name": name,
        "sensor": {"name": name.replace(" ", "_").replace(",", "")},
        "files": {"all": {"path": "data.csv", "time": {"column": "t", "unit": "s", "zero": "shared"}}},
        "trials": {"column": "trial"},
        "taxels": {"file": "all", "columns": "s*", "unit": kind.unit},
        "position": {
            "file": "all",
            "x": {"column": "x", "unit": "mm"},
            "y": 0.0,
            "depth": {"column": "depth", "unit": "mm"},
        },
    }
    if len({trial.specimen for trial in trials}) > 1:
        mapping["press"] = {"specimen": {"column": "material"}}
    measured = {}
    if kind.gauge:
        measured["laser"] = {"file": "all", "columns": ["laser"], "unit": "mm"}
    if kind.force:
        measured["force"] = {"file": "all", "columns": ["load"], "unit": "N"}
    if measured:
        mapping["measured"] = measured
    (folder / "mapping.yaml").write_text(json.dumps(mapping))  # JSON is YAML
    (folder / "truth.json").write_text(json.dumps(told))
