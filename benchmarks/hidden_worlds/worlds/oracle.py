"""How far apart two worlds are to one who knows their forms: the likelihood-ratio test of known signatures.

Readings differ between two worlds by a signature d. The random part is Gaussian with known covariance: coloured
noise, a gain a channel, offsets that wander between presses and within them, an error of pose a press. With a fitted
response any function of depth for each place, tool and channel is added. The signature's length in that metric,
delta, is the mean of the test's normal statistic: at a two-sided level of 1 % it is found half the time where delta =
2.58.
"""

import numpy as np
from scipy.interpolate import BSpline

from worlds import noise, skin, world
from worlds.physics import KNOWN

LEVEL = 2.576
"""Quantile of the normal distribution at a two-sided level of 1 % [1]."""
PHI = 0.3
FREE = 1e4  # counts, spread of an unknown value
POSE = (0.02, 0.02, 0.006)  # mm
TAU = 40.0  # s, of the wander of offsets
SPACING = 1.5  # s, most between the times of a press at which its offset is another number, straight in between


class Oracle:
    """One seed's presses, with the random part projected out."""

    def __init__(self, seed, settings, response="table"):
        """Prepare.

        Args:
            seed: The world's.
            settings: Of `world.SETTINGS`; noise is taken as plain.
            response: "table", or "fitted": any function of depth for each place, tool and channel is taken out too.
        """
        self.seed, self.settings = seed, {**world.SETTINGS, **settings}
        self.still = self._run({}, np.zeros(3))
        count = self.settings["episodes"]
        self.scale = float(np.sqrt((self.settings["noise"] ** 2 + 1 / 12) * (1 - PHI**2)))
        shifted = [self._run({}, np.eye(3)[axis] * POSE[axis]) - self.still for axis in range(3)]
        press = np.eye(count, dtype=np.float32)[self.episode]
        self.columns, self.inverse, self.jitter, self.crossed = [], [], [], []
        offsets, at = self._offsets()
        nodes, apart = len(at), np.abs(np.subtract.outer(at, at))
        prior = np.linalg.inv(noise.wandering("plain") ** 2 * np.exp(-apart / TAU) + FREE**2)
        splines = self._splines() if response == "fitted" else np.zeros((len(press), 0), np.float32)
        for c in range(skin.CHANNELS):
            a = self._white(np.concatenate([offsets, 0.03 * self.still[:, c : c + 1], splines], axis=1))
            normal = (a.T @ a).astype(float)
            normal[:nodes, :nodes] += prior
            normal[nodes, nodes] += 1.0
            normal[np.diag_indices(len(normal))] += 1e-6
            self.columns.append(a)
            self.inverse.append(np.linalg.inv(normal))
        inner = 0.0
        for c, (a, normal) in enumerate(zip(self.columns, self.inverse, strict=True)):
            j = self._white(np.concatenate([s[:, c, None].astype(np.float32) * press for s in shifted], axis=1))
            x = a.T @ j
            inner = inner + (j.T @ j).astype(float) - x.T @ normal @ x
            self.jitter.append(j)
            self.crossed.append(x)
        self.shaking = np.linalg.inv(inner + np.eye(len(inner)))

    def _run(self, effects, move):
        w = world.begin(self.seed, self.settings)
        world.run(w, self.seed, effects, np.tile(move, (len(w.presses), 1)))
        rows = world.frames(w, self.seed)
        self.episode, self.rows, self.w = w.episode[rows], rows, w
        self.span = w.clock[[[p[0], p[-1]] for p in w.presses]]
        return world.read(w, w.rise, rows)

    def _offsets(self):
        """Return the shape of each number that an offset wanders by, straight in between, and its time."""
        clock, shapes, times = self.w.clock[self.rows], [], []
        for press, (begin, end) in enumerate(self.span):
            at = np.linspace(begin, end, max(int(np.ceil((end - begin) / SPACING)), 1) + 1)
            own = self.episode == press
            shapes.append(np.zeros((len(clock), len(at)), np.float32))
            shapes[-1][own] = np.stack([np.interp(clock[own], at, unit) for unit in np.eye(len(at))], axis=1)
            times.append(at)
        return np.concatenate(shapes, axis=1), np.concatenate(times)

    def _splines(self):
        w, rows = self.w, self.rows
        share = np.clip(w.command[rows, 2] / max(w.command[:, 2].max(), 1e-9), 0, 1)
        knots = np.concatenate([[0, 0, 0], np.linspace(0, 1, 6), [1, 1, 1]])
        shape = BSpline.design_matrix(share, knots, 3).toarray()
        group = w.site[rows] * len(world.RADII) + w.tool[rows]
        return np.concatenate([shape * (group == g)[:, None] for g in np.unique(group)], axis=1).astype(np.float32)

    def _white(self, values):
        out = values.astype(np.float32) / self.scale
        out[1:] -= PHI * values[:-1].astype(np.float32) / self.scale
        return out

    def signature(self, effects):
        """Return the change of the readings by effects, whitened, shape (n, 24)."""
        return self._white(self._run(effects, np.zeros(3)) - self.still)

    def gram(self, signatures):
        """Return the inner products of signatures with the random part projected out, shape (k, k)."""
        total, with_pose = 0.0, 0.0
        for c in range(skin.CHANNELS):
            d = np.stack([s[:, c] for s in signatures], axis=1).astype(float)
            x = self.columns[c].T @ d
            total = total + d.T @ d - x.T @ self.inverse[c] @ x
            with_pose = with_pose + self.jitter[c].T @ d - self.crossed[c].T @ (self.inverse[c] @ x)
        return total - with_pose.T @ self.shaking @ with_pose

    def delta(self, effects):
        """Return the length of effects' signature [standard deviations]."""
        return float(np.sqrt(max(self.gram([self.signature(effects)])[0, 0], 0.0)))


def nearest(gram, mine, small, large, both=True):
    """Return how far a signature is from a rival's of any physical size [standard deviations].

    A rival's signature of x times its limit is taken as x u + x^2 q, u and q from those at one and three times.

    Args:
        gram: Inner products of signatures, shape (k, k).
        mine: Which is the truth's.
        small: Which is the rival's at its limit.
        large: Which is the rival's at three times its limit.
        both: Whether the rival may be of negative size.
    """
    x = np.concatenate([[0.0], np.geomspace(0.01, 200, 400)])
    x = np.concatenate([-x[:0:-1], x]) if both else x
    index = [mine, small, large]
    for _ in range(3):
        weights = np.stack([np.ones_like(x), -(9 * x - 3 * x**2) / 6, -(x**2 - x) / 6])
        left = np.einsum("ik,ij,jk->k", weights, gram[np.ix_(index, index)], weights)
        k = int(np.argmin(left))
        x = np.linspace(x[max(k - 1, 0)], x[min(k + 1, len(x) - 1)], 201)
    return float(np.sqrt(max(left.min(), 0.0)))


def limit(oracles, name, begin=None):
    """Return the size at which an effect is found half the time [1], the median over oracles; None if never.

    Args:
        oracles: Each with presses of its own.
        name: The effect.
        begin: Rough value of it, if that is known.
    """
    found = []
    for oracle in oracles:
        size = begin or 0.3
        for _ in range(4):
            delta = oracle.delta({name: size})
            if delta <= 0 or abs(delta / LEVEL - 1) < 0.02:
                break
            size = float(np.clip(size * np.clip(LEVEL / delta, 0.02, 50), 1e-4, KNOWN[name].most))
        found.append(size if delta > 0.8 * LEVEL else np.inf)
    middle = float(np.median(found))
    return round(middle, 5) if np.isfinite(middle) else None
