"""The time of exposure of every image of one camera in a finished recording, each with its own uncertainty.

An image arrives after a latency of at least the camera's minimum. On a busy computer the latency grows, and images are
lost. With a time stamp of the camera the two are distinguished: the line under arrival against stamp gives every
exposure. Stamps are believed only where they can be of exposures (`exposure_stamps`).

A number given on arrival is no evidence between a late and a lost image. Against a clock of constant period P, the
excess E = arrival - P number rises with both and falls only when lateness ends. So the lateness of an image is at
least E less the smallest later E, and at most that of the image before plus the rise of E. The time is taken from the
lower bound, and half the distance of the bounds is its standard uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.clocks.envelope_fit import CRYSTAL, HIDDEN, TYPICAL, append_to_hull
from tacdata.recording.clocks.exposure_stamps import ExposureStamps, exposure_stamps

NS = 1e-9
STEP_NS = 2_000_000_000
"""Change of arrival against stamp that is a step of the camera's clock, and no lateness [ns]."""
BLOCK_NS = 1_000_000_000
"""Length of a block of images, of which the smallest latency counts [ns]."""
STRAIGHT_NS, STEEPEST, BLOCKS = 3_000_000, 0.005, 5
"""A clock that runs wrong by more than a crystal: median distance of the blocks' smallest latencies from their line
[ns], largest slope of it [ns/ns], and fewest blocks [count].
"""
UNSURE_NS = 1_000_000
"""Standard uncertainty that the rate of a camera's clock leaves in the times of a recording [ns]."""
PERIODS = 0.01
"""Largest deviation of the period from its first guess [1]."""
PAIRS, NEAR = 6000, 5
"""Pairs of images from which the period is found [count]; they are at most this part of the recording apart."""
ALIKE = 0.25
"""Largest deviation of intervals from their median that count as the usual one [1]."""
KERNEL = 0.06
"""Scatter of a pair's distance about a multiple of the period [periods]."""
CHANCE = KERNEL * float(np.sqrt(2 * np.pi))
"""Share of pairs at multiples of any period, of arrivals without one [1]: the mean of the kernel over a whole turn."""
ODD = 0.1
"""Share of pairs an odd number of half periods apart, over those at multiples, from which the period is half [1]."""
WHOLE = 0.1
"""Largest distance of the usual interval from a multiple of the nominal period [periods]."""
TURN = 3.0
"""Multiples of the period by which the farthest pair may be off in the search [count]."""
CLEAR = 1.3
"""Smallest share of pairs at multiples of the period, over that of arrivals without a period [1]."""
NTSC, AS_WELL = 1.001, 0.9
"""Ratio of the periods of 29.97 and 30 Hz [1]; share of the best agreement at which a usual period is taken [1]."""
CRYSTAL_SIGMA, FITTED_SIGMA = 50e-6, 300e-6
"""Standard uncertainty of a usual period and of a fitted one [1]."""
FAR_NS = 10_000_000_000
"""Longest time over which the uncertainty of a period adds up: further on other images show it [ns]."""


@dataclass(frozen=True, eq=False)
class ImageClock:
    """Times of all images of one camera."""

    number: np.ndarray
    """Number of each image, shape (n,), int64, ascending."""
    time_ns: np.ndarray
    """Time of exposure of each [ns], shape (n,), int64."""
    uncertainty: np.ndarray
    """Standard uncertainty of each time [s], shape (n,)."""

    def sample_times(self, arrival_ns: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Return times of exposure [ns], shape (m,), int64; the arrival [ns] of an image that is not known."""
        rows, hits = self._rows(number)
        return np.where(hits, self.time_ns[rows], arrival_ns)

    def uncertainties(self, number: np.ndarray) -> np.ndarray:
        """Return standard uncertainties of times [s], shape (m,); the largest for an image that is not known."""
        rows, hits = self._rows(number)
        return np.where(hits, self.uncertainty[rows], self.uncertainty.max())

    def _rows(self, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rows = np.clip(np.searchsorted(self.number, number), 0, len(self.number) - 1)
        return rows, self.number[rows] == number


def image_clock(
    arrival_ns: np.ndarray,
    sequence: np.ndarray,
    device_ns: np.ndarray,
    model: ClockModel | None,
    rate: float | None = None,
) -> ImageClock | None:
    """Return the times of a camera's images; None with fewer than three.

    Args:
        arrival_ns: Host times of receipt [ns], shape (n,), int64.
        sequence: Numbers given on arrival, shape (n,), int64.
        device_ns: The camera's own times [ns], shape (n,), int64; -1 without one.
        model: The clock that the recorder fitted, which also knows the images before the recording.
        rate: Nominal rate of the camera [Hz]; None if unknown.
    """
    order = np.argsort(np.asarray(sequence, np.int64), kind="stable")
    arrival, number, device = (np.asarray(values, np.int64)[order] for values in (arrival_ns, sequence, device_ns))
    if len(arrival) < 3 or (np.diff(number) <= 0).any():
        return None
    stamps = exposure_stamps(arrival, device, rate)
    previous = model if model is not None and model.axis == ("device_ns" if stamps else "order") else None
    lateness, spread = (
        _stamped(arrival, device, stamps, previous) if stamps else _numbered(arrival, number, previous, rate)
    )
    constant = model.latency if model is not None else None
    time_ns = arrival - np.rint(lateness).astype(np.int64) - (constant.latency_ns if constant else 0)
    sigma = np.hypot(spread, constant.uncertainty_ns if constant else 0) * NS
    return ImageClock(number, time_ns, sigma)


def _stamped(
    arrival: np.ndarray, device: np.ndarray, stamps: ExposureStamps, model: ClockModel | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lateness of images with time stamps, and its standard uncertainty [ns], shape (n,) both."""
    order, arrival, device = stamps.order, arrival[stamps.order], device[stamps.order]
    excess = (arrival - arrival[0]) - (device - device[0]).astype(float)
    late, unsure = np.zeros(len(arrival)), np.zeros(len(arrival))
    # A fall of seconds is no lateness, whatever the period.
    believed = not len(stamps.begins) and bool((np.diff(order) > 0).all())
    begins = np.union1d(stamps.begins, np.flatnonzero(np.abs(np.diff(excess)) > STEP_NS) + 1)
    for first, end in pairwise([0, *begins.tolist(), len(arrival)]):
        rows = slice(first, end)
        slope, bend = _slope(device[rows] - device[first], excess[rows])
        above = excess[rows] - slope * (device[rows] - device[first])
        # The recorder's clock may know images before this recording that were less late. Its line takes stamps as they
        # come, so a step or an exchange bends it.
        known = _earlier(model, arrival[rows], device[rows], above) if believed else []
        # The least late image of a stretch counts as on time: nothing is known of a delay that all images share.
        late[rows] = above - min([float(above.min()), *known])
        unsure[rows] = np.hypot(_unsure(arrival[rows], late[rows]), np.hypot(UNSURE_NS, bend))
    lateness, spread = np.zeros(len(arrival)), np.zeros(len(arrival))
    lateness[order], spread[order] = late, np.hypot(unsure, stamps.doubt_ns)
    return lateness, spread


def _earlier(model: ClockModel | None, arrival: np.ndarray, device: np.ndarray, above: np.ndarray) -> list[float]:
    """Return the levels of the recorder's lines among latencies ``above`` a line [ns], near this recording only."""
    if model is None:
        return []
    middle = len(device) // 2
    lines = (*model.earlier, model)
    constant = model.latency.latency_ns if model.latency else 0
    levels = [above[middle] - (arrival[middle] - line.sample_of(int(device[middle])) - constant) for line in lines]
    return [float(level) for level in levels if abs(level - above.min()) < STEP_NS]


def _slope(device: np.ndarray, excess: np.ndarray) -> tuple[float, float]:
    """Return the slope of the line under latencies [ns/ns], and the uncertainty of times that it leaves [ns].

    It is as steep as a crystal's drift at most. A steeper one counts where the smallest latencies lie on it throughout:
    lateness does not grow along a line. Its excess over a crystal's drift leaves an uncertainty.
    """
    hull: list[tuple[int, int]] = []
    for point in zip(device.tolist(), np.rint(excess).astype(np.int64).tolist(), strict=True):
        append_to_hull(hull, point)
    if len(hull) < 2:
        return 0.0, 0.0
    # The edge under the middle: at the ends of a recording few latencies bound the line.
    edge = next((k for k in range(1, len(hull) - 1) if hull[k][0] >= device.mean()), len(hull) - 1)
    (x1, y1), (x2, y2) = hull[edge - 1], hull[edge]
    slope = (y2 - y1) / (x2 - x1)
    if CRYSTAL < abs(slope) < STEEPEST:
        block = device // BLOCK_NS
        lowest = [np.flatnonzero(block == k)[excess[block == k].argmin()] for k in np.unique(block)]
        deviation = np.abs(excess[lowest] - y1 - slope * (device[lowest] - x1))
        if len(lowest) >= BLOCKS and np.median(deviation) < STRAIGHT_NS:
            return slope, (abs(slope) - CRYSTAL) * float(device[-1] - device[0]) / 4
    return float(np.clip(slope, -CRYSTAL, CRYSTAL)), 0.0


def _numbered(
    arrival: np.ndarray, number: np.ndarray, model: ClockModel | None, rate: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lateness of images without time stamps, and its standard uncertainty [ns], shape (n,) both."""
    begun = (arrival - arrival[0]).astype(float)
    steps = np.diff(begun) / np.diff(number)
    usual = float(np.median(steps))
    # Where the rate changed, latencies draw the median to the other rate.
    usual = float(steps[np.abs(steps - usual) <= ALIKE * usual].mean())
    period, drift = _period(begun, usual, 1e9 / rate if rate else None)
    excess = begun - period * (number - number[0])
    # Numbers are given on arrival: a lost image raises the excess of all later ones for good, lateness does not. So an
    # image is at least as late as against the later ones, and at most as against the earlier ones.
    lower = excess - np.minimum.accumulate(excess[::-1])[::-1]
    upper = np.empty(len(excess))
    upper[0] = max(lower[0], _before(model, int(arrival[0]), int(number[0])))
    for k in range(1, len(excess)):
        upper[k] = max(lower[k], upper[k - 1] + excess[k] - excess[k - 1])
    spread = np.hypot(_unsure(arrival, lower), drift * min(float(begun[-1]), FAR_NS))
    return lower, np.hypot((upper - lower) / 2, spread)


def _before(model: ClockModel | None, arrival_ns: int, number: int) -> float:
    """Return how late the first image is against the recorder's lines, which know those before it [ns]; else 0."""
    if model is None or not model.steady:
        return 0.0
    constant = model.latency.latency_ns if model.latency else 0
    levels = [arrival_ns - line.sample_of(number) - constant for line in (*model.earlier, model)]
    return float(min((level for level in levels if 0 < level < STEP_NS), default=0.0))


def _period(begun: np.ndarray, usual: float, nominal: float | None) -> tuple[float, float]:
    """Return the period of exposures [ns] and its relative uncertainty: most close pairs are multiples of it apart.

    Lost images keep that, and a pair of which one image was later than the other counts for nothing. The nominal period
    is preferred where it agrees as well.

    Args:
        begun: Arrivals [ns], shape (n,).
        usual: Usual interval [ns].
        nominal: Nominal period [ns], or None.
    """
    # A fixed seed: one recording always has the same period.
    rng = np.random.default_rng(0)
    first = rng.integers(0, len(begun), PAIRS)
    second = np.clip(first + rng.integers(4, max(len(begun) // NEAR, 6), PAIRS), 0, len(begun) - 1)
    # Differences of random pairs: lateness of single images spreads the turns, and leaves their maximum at the period.
    pairs = begun[second] - begun[first]

    def agreeing(periods: np.ndarray, shift: float = 0.0) -> np.ndarray:
        turns = pairs[None, :] / periods[:, None] + shift
        return np.exp(-0.5 * ((turns - np.rint(turns)) / KERNEL) ** 2).mean(axis=1)

    def fitted(guess: float) -> tuple[float, float]:
        width = min(PERIODS, NEAR * guess / max(float(begun[-1]), 1.0) * TURN)
        tried = guess * (1 + np.linspace(-width, width, 201))
        shares = agreeing(tried)
        return float(tried[int(shares.argmax())]), float(shares.max())

    mean = float(begun[-1]) / (len(begun) - 1)
    if usual >= 0.5 * mean:
        found = fitted(usual)
    else:
        # Arrivals in batches have a median interval of nearly nothing, and any part of a batch's period agrees as well.
        found, half = fitted(mean), fitted(0.5 * mean)
        found = found if found[1] > AS_WELL * half[1] else half
    # Pairs a quarter of a period off are those without a period.
    odd, stray = (float(agreeing(np.array([found[0]]), shift)[0]) for shift in (0.5, 0.25))
    if odd - stray > ODD * max(found[1] - stray, CHANCE):
        found = fitted(found[0] / 2)
    turns = usual / nominal if nominal else 0.0
    for period, share in [found] if nominal is None else [fitted(nominal), found]:
        # A nominal period that does not divide the usual interval must agree as well as that one.
        divides = abs(turns - max(round(turns), 1)) < WHOLE
        if share < CLEAR * CHANCE or (period != found[0] and not divides and share < AS_WELL * found[1]):
            continue
        for usual_period in [] if nominal is None else [nominal, nominal * NTSC]:
            if float(agreeing(np.array([usual_period]))[0]) > AS_WELL * share:
                return usual_period, CRYSTAL_SIGMA
        return period, FITTED_SIGMA
    return (nominal or usual), FITTED_SIGMA


def _unsure(arrival: np.ndarray, lateness: np.ndarray) -> float:
    """Return the standard uncertainty of the smallest latency [ns]: how well blocks of images agree on it."""
    block = (arrival - arrival[0]) // BLOCK_NS
    # The smallest is usually 0 by construction, so the second block is the first that can disagree.
    minima = np.sort([lateness[block == k].min() for k in np.unique(block)])
    usual = float(np.median(lateness))
    return max(TYPICAL * float(minima[min(1, len(minima) - 1)]), HIDDEN * min(usual, float(np.quantile(lateness, 0.3))))
