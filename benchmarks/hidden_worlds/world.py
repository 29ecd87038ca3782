"""A world: what was commanded, what is true, what was read. Written to one file; the truth to another."""

import json
from types import SimpleNamespace

import numpy as np
import physics
import protocol
import skin

RATE = 30.0
RADII = (4.0, 2.0)


def make(seed, effects, protocol_name="rich", episodes=48, noise=4.0):
    """Return the recordings (dict of arrays) of a world.

    Args:
        seed: Decides everything random.
        effects: Name -> size.
        protocol_name: "rich" or "poor".
        episodes: How many presses.
        noise: Standard deviation of a reading [counts].
    """
    rng = np.random.default_rng([seed, 77])
    presses = getattr(protocol, protocol_name)(rng, episodes)
    fine = protocol.path(presses)
    clock, episode = fine[:, 0], fine[:, 1].astype(int)
    tool = fine[:, 5].astype(int)
    _, site = np.unique(fine[:, 2:4], axis=0, return_inverse=True)
    pose = fine[:, 2:5].copy()
    jitter = rng.normal(0, [0.02, 0.02, 0.006], (len(presses), 3))
    pose += jitter[episode]
    w = SimpleNamespace(
        rng=rng, clock=clock, episode=episode, site=site.ravel(), pose=pose, radius=np.array(RADII)[tool], layer=3.3,
        fresh=np.diff(episode, prepend=-1) != 0, gap=np.diff(clock, prepend=clock[0]),
        delay=np.zeros(len(clock)), scan=0.0,
    )
    for stage in (physics.KINEMATICS, physics.LAYER):
        run(stage, w, effects)
    w.load = skin.loads(w.pose[:, 0], w.pose[:, 1], w.pose[:, 2], w.radius, w.layer)
    run(physics.MATERIAL, w, effects)
    w.rise = skin.counts(w.load)
    run(physics.READOUT, w, effects)
    run(physics.TIMING, w, effects)
    spread = 1 + 0.03 * rng.normal(size=24)
    wander = colored(rng, len(clock), w.gap, 40.0, 24) * 1.5
    clean = skin.OFFSET + 300 * rng.normal(size=24) + w.rise * spread + wander
    return sample(w, fine, tool, clean, rng, noise)


def run(stage, w, effects):
    """Let those of a stage act that the world has."""
    for f in stage:
        if f.__name__ in effects:
            f(w, effects[f.__name__])


def colored(rng, n, gap, tau, k):
    """Slow wander of unit spread."""
    out, last = np.zeros((n, k)), rng.normal(size=k)
    a = np.exp(-gap / tau)
    kick = rng.normal(size=(n, k)) * np.sqrt(1 - a**2)[:, None]
    for i in range(n):
        last = a[i] * last + kick[i]
        out[i] = last
    return out


def sample(w, fine, tool, clean, rng, noise):
    """Read at the sensor's rate, late as the world has it; add noise; round."""
    rows = [np.arange(r[0] + rng.integers(8), r[-1] + 1, int(protocol.FINE / RATE))
            for r in np.split(np.arange(len(fine)), np.flatnonzero(w.fresh)[1:])]
    pick = np.concatenate(rows)
    time = w.clock[pick]
    read = np.empty((len(pick), clean.shape[1]))
    begin = w.clock[np.flatnonzero(w.fresh)][w.episode[pick]]
    for c in range(clean.shape[1]):
        late = w.delay[pick] + w.scan * (c / (clean.shape[1] - 1) - 0.5)
        read[:, c] = np.interp(np.maximum(time - late, begin), w.clock, clean[:, c])
    shaky = rng.normal(size=read.shape)
    for i in range(1, len(shaky)):
        shaky[i] = 0.3 * shaky[i - 1] + np.sqrt(1 - 0.09) * shaky[i]
    read = np.round(read + noise * shaky)
    last = w.fresh.cumsum()[pick] - 1
    return {
        "time": time, "episode": last, "tip": fine[pick, 2:5], "tool": tool[pick], "readings": read,
        "site": w.site[w.fresh.nonzero()[0]],
        "centers": skin.centers(), "radii": np.array(RADII), "pose": w.pose[pick],
        "path_time": w.clock[::2], "path_episode": w.episode[::2], "path": fine[::2, 2:5],
    }  # fmt: skip


def write(folder, name, seed, effects, **settings):
    """Write a world and, apart from it, its truth."""
    data = make(seed, effects, **settings)
    np.savez_compressed(folder / f"{name}.npz", **{k: v for k, v in data.items() if k != "pose"})
    (folder / "truth").mkdir(exist_ok=True)
    truth = {"seed": seed, "effects": effects, **settings}
    (folder / "truth" / f"{name}.json").write_text(json.dumps(truth))
