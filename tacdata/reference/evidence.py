"""Probabilities of mechanisms: Gaussian evidence of each set of shapes, with a remainder of unknown size.

The difference of a condition is a sum of shapes, an offset, a smooth remainder and noise. Sizes have Gaussian priors,
so the evidence of a set is exact; the remainder's size is integrated over a grid. The posterior is averaged over
bootstrap samples of presses (BayesBag; Huggins and Miller, Bayesian Analysis 2023): a set that few presses support
loses.
"""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp, softmax

from tacdata.reference.conditions import PressKind
from tacdata.reference.shapes import Shape

REMAINDERS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Sizes of the remainder to integrate over, as shares of the difference's root mean square [1]."""
LONG, SHORT = 0.15, 0.02
"""Correlation lengths of the remainder, as shares of the press [1]."""
STEADY, CHANGING = 0.3, 3.0
"""Size of its short part where the speed is steady and where it changes, over the long part [1]: machines overshoot
there, each in a way of its own."""
EDGE = 0.5
"""Error of a point where the speed changes, over the difference's root mean square: edges of shapes are off by a point
of the clock [1]."""
NEAR = 0.03
"""Share of the press around a change of speed that counts as changing [1]."""
ABRUPT = 0.2
"""A speed that changes by more within `NEAR` changes, over the fastest [1]."""
PRIOR = 0.1
"""Prior odds of one more mechanism: a machine has one fault before it has two [1]."""
MOST = 3
"""Mechanisms in a set at most."""
EXCLUSIVE = (frozenset({"latency", "low_pass_filter"}), frozenset({"z_offset", "backlash"}))
"""Mechanisms of which one does for the form error of the other."""
DRAWS = 24
"""Bootstrap samples of the presses."""
BLOCKS = 5
"""Blocks of consecutive presses: their scatter contains the variation from press to press."""
OFFSET = 1.0
"""Prior size of the offset of a condition, in ranges of the base [1]."""


@dataclass(frozen=True)
class Posterior:
    """Components of the difference."""

    mechanisms: dict[str, float]
    """Probability that a mechanism is in the set [1]."""
    best: tuple[int, ...]
    """Shapes of the most probable set, by number."""
    of_shape: tuple[float, ...]
    """Probability of each shape [1]."""
    support: tuple[float, ...]
    """Of the best set with each shape: natural logarithm of its evidence and prior mass [1]."""


def blocks(presses: np.ndarray) -> np.ndarray:
    """Return means of blocks of consecutive presses, shape (blocks, t, channels)."""
    return np.stack([b.mean(axis=0) for b in np.array_split(presses, min(BLOCKS, len(presses)))])


def posterior(conditions: tuple[PressKind, ...], columns: list[list[Shape]]) -> Posterior:
    """Return the probabilities of mechanisms.

    Args:
        conditions: The conditions.
        columns: The shapes of each condition, in the same order for all.
    """
    sets = _sets(columns[0])
    mass = np.array([_prior(columns[0], members) for members in sets])
    evidence = np.zeros((len(sets), DRAWS + 1))
    for condition, shapes_of in zip(conditions, columns, strict=True):
        for channel in range(condition.base.shape[1]):
            # The unnamed remainder has a size of its own in each condition and channel.
            sizes = np.stack([system.evidence(sets) for system in _systems(condition, shapes_of, channel)])
            evidence += logsumexp(sizes, axis=0) - np.log(len(REMAINDERS))
    evidence += np.log(mass)[:, None]
    weights = softmax(evidence, axis=0)
    # Averaged over draws of the blocks, so that one session's accidents decide less; column 0 is the data themselves.
    of_set = weights[:, 1:].mean(axis=1)
    names = [s.mechanism for s in columns[0]]
    probabilities = {
        n: float(sum(p for p, s in zip(of_set, sets, strict=True) if n in {names[i] for i in s})) for n in names
    }
    each = tuple(float(sum(p for p, s in zip(of_set, sets, strict=True) if k in s)) for k in range(len(names)))
    support = tuple(
        float(max(e for e, s in zip(evidence[:, 0], sets, strict=True) if k in s)) for k in range(len(names))
    )
    return Posterior(probabilities, sets[int(np.argmax(of_set))], each, support)


@dataclass(frozen=True)
class System:
    """Normal equations of one condition and channel, whitened by the remainder and the noise."""

    gram: np.ndarray
    """Of the shapes in units of their typical size, and the offset last [1], shape (shapes + 1, shapes + 1)."""
    target: np.ndarray
    """Shapes times the difference and its bootstrap draws [1], shape (shapes + 1, draws + 1)."""
    constant: np.ndarray
    """Log density of the difference without shapes, offset apart [1], shape (draws + 1,)."""

    def evidence(self, sets: list[tuple[int, ...]]) -> np.ndarray:
        """Return the log evidence of sets, shape (sets, draws + 1)."""
        log_evidence = np.empty((len(sets), self.target.shape[1]))
        counts = np.array([len(s) for s in sets])
        # Sets of one size are factorized together.
        for count in np.unique(counts).tolist():
            rows = np.flatnonzero(counts == count)
            columns = np.array([[*sets[r], len(self.gram) - 1] for r in rows])
            # Sizes are in units of their typical one, whose prior precision is 1.
            matrix = self.gram[columns[:, :, None], columns[:, None]] + np.eye(count + 1)
            lower = np.linalg.cholesky(matrix)
            half = np.linalg.solve(lower, self.target[columns])
            size = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
            log_evidence[rows] = self.constant + 0.5 * np.square(half).sum(axis=1) - size[:, None]
        return log_evidence


def whitener(condition: PressKind, channel: int, remainder: float) -> np.ndarray:
    """Return the lower factor of the covariance of remainder and noise, shape (t, t) [the source's unit]."""
    share = np.linspace(0.0, 1.0, len(condition.time))
    separation = np.square(share[:, None] - share[None])
    rms = float(np.sqrt(np.mean(np.square(condition.difference[:, channel]))))
    size = np.where(changing(condition), CHANGING, STEADY)
    kernel = np.exp(-0.5 * separation / LONG**2) + size[:, None] * np.exp(-0.5 * separation / SHORT**2) * size
    noise = sum(
        np.var(side[:, :, channel], axis=0, ddof=1).mean() / len(side)
        for side in (condition.healthy, condition.measured)
    )
    # Simulated readings have no noise, and the covariance would be singular.
    floor = max(float(noise), (1e-4 * float(condition.range[channel])) ** 2, 1e-300)
    edges = np.where(changing(condition), (EDGE * rms) ** 2, 0.0)
    return np.linalg.cholesky((remainder * rms) ** 2 * kernel + np.diag(floor + edges))


def changing(condition: PressKind) -> np.ndarray:
    """Return where the speed changes, begins or ends, shape (t,), bool."""
    speed = np.gradient(condition.depth, condition.time)
    width = max(round(NEAR * len(speed)), 1)
    padded = np.pad(speed, width)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * width + 1)
    return np.ptp(windows, axis=1) > ABRUPT * np.abs(speed).max()


def _systems(condition: PressKind, columns: list[Shape], channel: int) -> list[System]:
    """Return the normal equations of a condition and channel, one for each size of the remainder."""
    # A fixed seed: the same sessions always get the same answer.
    rng = np.random.default_rng(0)
    sides = [blocks(condition.healthy)[:, :, channel], blocks(condition.measured)[:, :, channel]]
    draws = [condition.difference[:, channel]]
    for _ in range(DRAWS):
        means = [side[rng.integers(0, len(side), len(side))].mean(axis=0) for side in sides]
        draws.append(means[1] - means[0])
    matrix = [s.curves[:, channel] * s.typical[channel] for s in columns]
    matrix.append(np.full(len(condition.time), OFFSET * condition.range[channel]))
    systems = []
    for remainder in REMAINDERS:
        lower = whitener(condition, channel, remainder)
        white = solve_triangular(lower, np.column_stack(matrix), lower=True)
        target = solve_triangular(lower, np.column_stack(draws), lower=True)
        constant = -0.5 * np.square(target).sum(axis=0) - np.log(np.diag(lower)).sum()
        systems.append(System(white.T @ white, white.T @ target, constant))
    return systems


def _sets(columns: list[Shape]) -> list[tuple[int, ...]]:
    """Return all sets of shapes with at most one form of each mechanism."""
    forms: dict[str, list[int]] = {}
    for k, shape in enumerate(columns):
        forms.setdefault(shape.mechanism, []).append(k)
    sets: list[tuple[int, ...]] = [()]
    for count in range(1, MOST + 1):
        for mechanisms in combinations(forms, count):
            if any(pair <= set(mechanisms) for pair in EXCLUSIVE):
                continue
            sets += list(product(*(forms[m] for m in mechanisms)))
    return sets


def _prior(columns: list[Shape], members: tuple[int, ...]) -> float:
    """Return a set's prior mass: forms share that of their mechanism."""
    mass = 1.0
    for k in members:
        mass *= PRIOR / sum(s.mechanism == columns[k].mechanism for s in columns)
    return mass
