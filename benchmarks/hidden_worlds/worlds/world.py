"""A world: commanded paths, true effects, readings."""

import zlib
from types import SimpleNamespace

import numpy as np

from worlds import noise, protocol, skin
from worlds.follow import wander
from worlds.physics import KNOWN, STAGES

RATE = 30.0
RADII = (4.0, 2.0)
SETTINGS = {
    "protocol": "rich",
    "episodes": 48,
    "noise": 4.0,
    "realism": "plain",
    "sessions": 1,
    "streams": (),
    "more": (),
}
"""Default settings of a world; streams: tag, force, temperature; more: presses after its own."""
TAG_NOISE, FORCE_NOISE, WARM_NOISE = 0.02, 0.01, 0.05  # mm, N, degC


def begin(seed, settings):
    """Return the state of a world before anything is hidden in it."""
    rng = np.random.default_rng([seed, 11])
    presses = [*protocol.KNOWN[settings["protocol"]](rng, settings["episodes"]), *settings["more"]]
    fine, session = protocol.path(presses, settings["sessions"])
    episode = fine[:, 1].astype(int)
    _, site = np.unique([(p["x"], p["y"]) for p in presses], axis=0, return_inverse=True)
    clock = fine[:, 0]
    warm = 24 + 4 * np.sin(2 * np.pi * clock / clock[-1] * 0.8 - 1.0) + 2 * clock / clock[-1]
    w = SimpleNamespace(
        clock=clock,
        episode=episode,
        site=site.ravel()[episode],
        session=session,
        step=1 / protocol.FINE,
        presses=np.split(np.arange(len(clock)), np.flatnonzero(np.diff(episode)) + 1),
        fresh=np.diff(episode, prepend=-1) != 0,
        gap=np.diff(clock, prepend=clock[0]),
        tool=fine[:, 5].astype(int),
        radius=np.array(RADII)[fine[:, 5].astype(int)],
        layer=skin.LAYER,
        command=fine[:, 2:5],
        carriage=fine[:, 2:5].copy(),
        tag_error=np.zeros((len(clock), 3)),
        warm=warm,
        delay=np.zeros(len(clock)),
        scan=np.zeros(len(clock)),
        table={},
        parameters={},
        rng=None,
    )
    # Closing over the world itself would be a cycle, which keeps its arrays until the collector comes by.
    told = w.parameters
    w.tell = lambda name, **values: told.__setitem__(name, {k: float(v) for k, v in values.items()})
    w.begins = clock[[rows[0] for rows in w.presses]][episode]
    return w


def run(w, seed, effects, jitter):
    """Let a world happen: fills in pose, load, rise.

    Args:
        w: As begun.
        seed: The world's.
        effects: Name -> size [1].
        jitter: Error of pose of every press [mm], shape (episodes, 3).
    """
    for stage in STAGES:
        if stage == "mounting":
            w.pose = w.carriage + jitter[w.episode]
        if stage == "skin":
            w.load = skin.both(w.pose, w.radius, w.layer)
        if stage == "taxel":
            w.rise = skin.counts(w.load[:, :-1])
        for name, size in effects.items():
            if KNOWN[name].stage == stage:
                w.rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
                KNOWN[name].act(w, size)
    return w


def read(w, values, rows):
    """Return a quantity as read at rows of the fine clock, late as the world has it, shape (m, k)."""
    out = np.empty((len(rows), values.shape[1]))
    for c in range(values.shape[1]):
        late = w.delay[rows] + w.scan[rows] * (c / max(values.shape[1] - 1, 1) - 0.5)
        out[:, c] = np.interp(np.maximum(w.clock[rows] - late, w.begins[rows]), w.clock, values[:, c])
    return out


def frames(w, seed):
    """Return the rows of the fine clock at which the sensor reads."""
    rng = np.random.default_rng([seed, 12])
    return np.concatenate([np.arange(r[0] + rng.integers(8), r[-1] + 1, int(protocol.FINE / RATE)) for r in w.presses])


def path_rows(w, count):
    """Return the rows of the fine clock that make up the path: every other, and corners of presses that were added.

    A lab's path has a row at each of its corners.
    """
    bend = np.zeros(len(w.clock), dtype=bool)
    bend[1:-1] = np.any(np.abs(np.diff(w.command, 2, axis=0)) > 1e-9, axis=1)
    bend &= w.episode >= count
    bend[::2] = True
    return np.flatnonzero(bend)


def make(seed, effects, **given):
    """Return a world's recordings, its truth, and the settings of its table.

    Args:
        seed: Decides everything random.
        effects: Name -> size [1].
        **given: Of `SETTINGS`.
    """
    settings = {**SETTINGS, **given}
    constants = np.random.default_rng([seed, 13])
    own, idle = noise.gains(constants, settings["realism"]), skin.OFFSET + 300 * constants.normal(size=skin.CHANNELS)
    rng = np.random.default_rng([seed, 77])
    w = begin(seed, settings)
    run(w, seed, effects, noise.contact(rng, w, settings["realism"]))
    rows, said = noise.kept(rng, frames(w, seed), settings["realism"])
    clean = idle + read(w, w.rise, said) * own
    clean += noise.wandering(settings["realism"]) * wander(rng, w, 40.0, skin.CHANNELS)[said]
    readings = noise.shaken(rng, w.clock[rows], clean, settings["noise"], settings["realism"])
    again = np.flatnonzero(said != rows)
    readings[again] = readings[again - 1]  # a repeated frame has the noise of the first time
    way = path_rows(w, settings["episodes"])
    data = {
        "time": w.clock[rows],
        "episode": w.episode[rows],
        "readings": readings,
        "tool": w.tool[[r[0] for r in w.presses]],
        "session": w.session,
        "site": w.site[[r[0] for r in w.presses]],
        "centers": skin.centers(),
        "radii": np.array(RADII),
        "path_time": w.clock[way],
        "path_episode": w.episode[way],
        "path": w.command[way],
    }
    if "tag" in settings["streams"]:
        data["tag"] = (w.carriage + w.tag_error)[rows] + TAG_NOISE * rng.normal(size=(len(rows), 3))
    if "force" in settings["streams"]:
        data["force"] = w.load[rows, -1] + FORCE_NOISE * rng.normal(size=len(rows))
    if "temperature" in settings["streams"]:
        data["temperature"] = w.warm[rows] + WARM_NOISE * rng.normal(size=len(rows))
    return data, truth(seed, effects, settings, w, rows), w.table


def truth(seed, effects, settings, w, rows):
    """Return data for the scorer alone: the same presses again, the true model without random parts, poses."""
    again, known = begin(seed, settings), begin(seed, settings)
    fresh = np.random.default_rng([seed, 78])
    run(again, seed, effects, noise.contact(fresh, again, settings["realism"]))
    run(known, seed, effects, np.zeros((len(known.presses), 3)))
    return {
        "time": w.clock[rows],
        "episode": w.episode[rows],
        "pose": w.pose[rows],
        "command": w.command[rows],
        "radius": w.radius[rows],
        "layer": np.full(len(rows), w.layer),
        "again": read(again, again.rise, rows),
        "oracle": read(known, known.rise, rows),
        "parameters": w.parameters,
    }
