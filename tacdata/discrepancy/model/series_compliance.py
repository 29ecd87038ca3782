"""Compliance in series with the specimen, estimated from specimens of other stiffness without a model or a gauge.

A machine gives way by C F. One specimen's curve takes that up: nobody knows its law. But the frame is the same for
all specimens, and a stiff one bends it more: with the right C, one contact law follows them all (direct method of
frame compliance: Oliver & Pharr, J. Mater. Res. 7, 1992, 1564). A power and a compliance for all must follow as well as
a power for each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.model.contexts import contexts

POWERS = np.arange(0.8, 3.21, 0.05)
"""Of depth, that a common law may have [1]."""
BINS = 20
"""Each press is averaged over so many steps of its load."""
BEGINS = 0.1
"""Loads below are touch and noise [largest of the press]."""
IDLE = 0.05
"""Share of a press's stroke at its shallow end, in which nothing is loaded [1]."""
NOISE = 5.0
"""...and so are those below so many standard deviations of the load in the air [1]."""
SPECIMENS, EACH = 3, 3
"""Fewer specimens, or presses of each, say nothing. A power and a compliance fit any two curves."""
STIFFER = 3.0
"""The stiffest is so many times as stiff as the softest, or they bend the frame equally [1]."""
CLOSES = 0.5
"""Share of a common law's residual beyond the noise that the compliance must close [1]."""
SURE = 3.8
"""The compliance over its standard error [1]: as an effect that raced."""


@dataclass(frozen=True)
class SeriesCompliance:
    """Estimate of a compliance in series from specimens of other stiffness."""

    compliance: float
    """C [mm over the unit of the load]."""
    error: float
    """Its standard error, by the jackknife over presses."""
    largest: float
    """Largest load [its unit]."""
    power: float
    """The common law's power of depth [1]."""
    specimens: int
    left: tuple[float, float]
    """Share of depths that the common law leaves of the clearest specimen: without and with it [1]."""

    def __str__(self) -> str:
        """Return it in words."""
        uncorrected, corrected = (f"{100 * share:.2g} %" for share in self.left)
        return (
            f"if the frame gives way by {self.compliance:.3g} +- {self.error:.1g} mm per unit of the load "
            f"({self.compliance * self.largest:.2g} mm at most), one law (depth to the power {self.power:.2g}) follows "
            f"all {self.specimens} specimens: of the one that shows it most it misses {corrected} of the depth, "
            f"{uncorrected} without"
        )


def series_compliance(course: Course) -> SeriesCompliance | None:
    """Return the compliance that specimens share; None where they show none, or cannot.

    The load is the force, or the only channel's reading.
    """
    presses = list(_presses(course))
    of = np.array([p.specimen for p in presses])
    members = [s for s in np.unique(of) if np.count_nonzero(of == s) >= EACH] if len(of) else []
    presses = [p for p in presses if p.specimen in members]
    if len(members) < SPECIMENS:
        return None
    of = np.array([p.specimen for p in presses])
    stiff = [float(np.median([p.stiffness for p in presses if p.specimen == s])) for s in members]
    # Equally stiff specimens bend the frame equally: compliance then looks like the law itself.
    if max(stiff) < STIFFER * min(stiff):
        return None
    products = np.array([[p.products(n) for n in POWERS] for p in presses])  # presses, powers, 3
    noise = np.array([_noise(products[of == s], sum(len(p.load) for p in presses if p.specimen == s)) for s in members])
    products /= noise[np.searchsorted(members, of)][:, None, None]
    bare, (at, c) = int(np.argmin(products[:, :, 0].sum(axis=0))), _best(products)
    without, with_it, individual = products[:, bare, 0], _left(products[:, at], c), np.zeros(len(presses))
    for s in members:
        individual[of == s] = products[of == s][:, int(np.argmin(products[of == s, :, 0].sum(axis=0))), 0]
    count = len(presses)
    each = np.array([_best(np.delete(products, k, axis=0))[1] for k in range(count)])
    # The jackknife over presses, as readings of one press are correlated.
    error = float(np.sqrt((count - 1) / count * np.square(each - each.mean()).sum()))
    better, worse, chance = without - with_it, with_it - individual, sum(len(p.load) - 2 for p in presses)
    is_visible = 0 < with_it.sum() - chance <= (1 - CLOSES) * (without.sum() - chance) or with_it.sum() <= chance
    # Where a power of each specimen's own explains more, the specimens differ by their law.
    differ = worse.mean() > worse.std(ddof=1) / np.sqrt(count)
    clearest = max(members, key=lambda s: float(better[of == s].sum()))
    # Noise in the load bends all curves a little: one specimen at least must show it plainly.
    plain = with_it[of == clearest].sum() <= (1 - CLOSES) * without[of == clearest].sum()
    # A power at the end of the grid is a bound, not an optimum: the law is then another one.
    if not (is_visible and plain) or differ or c < SURE * error or not 0 < at < len(POWERS) - 1:
        return None
    factor = noise[members.index(clearest)] / sum(p.change for p in presses if p.specimen == clearest)
    depths = (
        float(np.sqrt(without[of == clearest].sum() * factor)),
        float(np.sqrt(with_it[of == clearest].sum() * factor)),
    )
    return SeriesCompliance(c, error, max(p.largest for p in presses), float(POWERS[at]), len(members), depths)


@dataclass(frozen=True)
class _Press:
    """One loading, averaged over steps of its load."""

    specimen: int
    depth: np.ndarray
    """[mm], shape (k,)."""
    load: np.ndarray
    """Above that in the air, shape (k,)."""

    @property
    def largest(self) -> float:
        """Largest load."""
        return float(self.load.max())

    @property
    def stiffness(self) -> float:
        """Largest load over the depth in which it rose."""
        return self.largest / max(float(np.ptp(self.depth)), 1e-12)

    @property
    def change(self) -> float:
        """Sum of squares of the depth about its mean [mm^2]."""
        return float(np.square(self.depth - self.depth.mean()).sum())

    def products(self, power: float) -> tuple[float, float, float]:
        """Return z.z, z.F and F.F: depth z and load F given the press's own touch and factor of a power law."""
        law = np.stack([np.ones_like(self.load), self.load ** (1 / power)], axis=1)
        pair = np.stack([self.depth, self.load], axis=1)
        residual = pair - law @ np.linalg.lstsq(law, pair, rcond=None)[0]
        return (
            float(residual[:, 0] @ residual[:, 0]),
            float(residual[:, 0] @ residual[:, 1]),
            float(residual[:, 1] @ residual[:, 1]),
        )


def _left(products: np.ndarray, c: float) -> np.ndarray:
    """Return the residual of each press under a compliance, shape (presses,)."""
    return products[:, 0] - 2 * c * products[:, 1] + c**2 * products[:, 2]


def _noise(products: np.ndarray, count: int) -> float:
    """Return the mean square of one specimen given the power and compliance that fit it best [mm^2].

    Args:
        products: Products of its presses, shape (presses, powers, 3).
        count: How many values are behind them.
    """
    total = products.sum(axis=0)
    smallest = float((total[:, 0] - total[:, 1] ** 2 / np.maximum(total[:, 2], 1e-300)).min())
    return max(smallest / max(count - 2 * len(products) - 2, 1), 1e-16)


def _best(products: np.ndarray) -> tuple[int, float]:
    """Return the power's number and the compliance that fit presses best, shape (presses, powers, 3)."""
    total = products.sum(axis=0)
    each = total[:, 1] / np.maximum(total[:, 2], 1e-300)
    at = int(np.argmin(total[:, 0] - each * total[:, 1]))
    return at, float(each[at])


def _presses(course: Course) -> list[_Press]:
    """Return the loadings of a course."""
    rows = course.reduced
    load = rows.force if rows.force is not None else rows.readings[:, 0] if course.channels == 1 else None
    if load is None:
        return []
    specimen, result = contexts(rows), []
    for e in range(course.episodes):
        indices = np.flatnonzero((rows.episode == e) & np.isfinite(load))
        if len(indices) < BINS:
            continue
        depth = rows.tip[indices, 2]
        idle = depth <= depth.min() + IDLE * np.ptp(depth)
        air = load[indices][idle]
        rise = load[indices] - np.median(air)
        # Test machines count compression as positive or as negative.
        rise = rise * np.sign(rise[np.argmax(np.abs(rise))])
        down = np.arange(len(indices)) <= int(np.argmax(depth))
        loaded = down & (rise >= max(BEGINS * rise.max(), NOISE * float(air.std())))
        # Bins of equal load, so that a slow press does not count more than a quick one.
        step = np.minimum((rise[loaded] / max(float(rise.max()), 1e-300) * BINS).astype(int), BINS - 1)
        count = np.bincount(step, minlength=BINS)
        if np.count_nonzero(count) < BINS // 2:
            continue
        mean = [np.bincount(step, v[loaded], minlength=BINS)[count > 0] / count[count > 0] for v in (depth, rise)]
        result.append(_Press(int(specimen[indices[0]]), *mean))
    return result
