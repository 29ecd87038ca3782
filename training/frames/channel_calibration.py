"""Calibration of a unit's channels: the force on each protrusion from its reading, fitted on labelled presses.

    force = spread(gain_k sign(c) (|c| / 1000 counts)^exponent)

The gain is the channel's own, the exponent common. The labels know the force on each protrusion from the skin model.
So a few presses that touch every taxel are enough. Gains are shrunk towards their mean by their uncertainty: a
channel that was hardly touched takes the mean, one that was touched often its own value. A unit's skin may spread a
load less far than the model's. So its forces are spread over neighbours, by one variance (`training.frames.spreading`).
The errors of exponent and variance come from the jackknife over presses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.training.frames.spreading import laplacian, spreading
from tacdata.training.networks.network import CALIBRATION_UNIT

if TYPE_CHECKING:
    from tacdata.sensor.sensor import Taxels
    from tacdata.training.frames.frames import Frames

SPREAD = 0.1
"""Standard deviation of a unit's gains about their mean that a stated error allows at least [1]."""
EXPONENTS = np.linspace(0.4, 3.0, 53)
"""Exponents that are tried [1], shape (53,); the result is between two of them."""
FEWEST = 3
"""Presses below which gains are reported as unknown [count]."""
UNSURE = 0.15
"""Standard error of the exponent above which it is reported [1]: pretraining varies the exponent by as much."""
_TOUCHED = 0.1
"""Least force on a channel that some press touched, over the largest force on the median channel [1]."""
_GROUPS = 20
"""Groups of presses that the jackknife leaves out, one after the other, where there are more presses [1]."""
_TURNS = 8
"""How often gains and spreading are fitted after each other [count]."""
FARTHEST = 4.0
"""Largest variance of the spreading, of either sign [mm^2]: about a pitch; a pattern is lost beyond."""
_SWAPPED = 0.2
"""By how much the correlation with another channel's force must be the larger one, both ways, for a swap [1]."""
_LOADED = 0.1
"""Largest force on a channel over that of some press from which its order is judged [1].

Without it 1.1 % of draws of two presses were refused on six rigs, with it 0 of 900. In 20 presses 80 % of swaps are
found both ways (80.4 and 80.3 %)."""


@dataclass(frozen=True)
class ChannelCalibration:
    """The force on each protrusion from its reading.

    Example:
        >>> import numpy as np
        >>> from tacdata.training.frames.channel_calibration import ChannelCalibration
        >>> nothing = np.zeros(24)
        >>> calibration = ChannelCalibration(np.full(24, 0.2), 1.5, nothing, 0.0, 10)
        >>> float(calibration.force(np.full((1, 24), 2000.0))[0, 0].round(3))  # 0.2 N at 1000 counts
        0.566
    """

    gain: np.ndarray
    """Force at 1000 counts [N], shape (taxels,)."""
    exponent: float
    """Exponent of the reading [1], the same for all channels."""
    gain_error: np.ndarray
    """Standard error of the gains [N], shape (taxels,); `SPREAD` of the mean for a channel that no press touched."""
    exponent_error: float
    """Standard error of the exponent [1]."""
    presses: int
    """Presses that it was fitted on."""
    spread: float = 0.0
    """Variance by which the model spreads a load farther than the unit [mm^2], along each axis."""
    spread_error: float = 0.0
    """Its standard error [mm^2]."""
    mixing: np.ndarray | None = None
    """Spreads the unit's forces to match the model [1], shape (taxels, taxels); None without."""

    def force(self, counts: np.ndarray) -> np.ndarray:
        """Return forces [N] of tared readings [counts], shapes (n, taxels)."""
        force = _power(counts, self.exponent) * self.gain
        return force if self.mixing is None else force @ self.mixing.T

    @property
    def document(self) -> dict[str, Any]:
        """The calibration as plain data (in `schemas/checkpoint.schema.json`)."""
        return {
            "gain": self.gain.tolist(),
            "gain_error": self.gain_error.tolist(),
            "exponent": self.exponent,
            "exponent_error": self.exponent_error,
            "presses": self.presses,
            "spread": self.spread,
            "spread_error": self.spread_error,
        }

    @classmethod
    def from_document(cls, document: dict[str, Any], taxels: Taxels) -> ChannelCalibration:
        """Rebuild a calibration of these taxels from `document`."""
        gain, error = (np.asarray(document[name], float) for name in ("gain", "gain_error"))
        variance = document.get("spread", 0.0)
        return cls(
            gain,
            document["exponent"],
            error,
            document["exponent_error"],
            document["presses"],
            variance,
            document.get("spread_error", 0.0),
            spreading(taxels, variance) if variance else None,
        )


def calibrate(frames: Frames, episodes: tuple[int, ...]) -> ChannelCalibration:
    """Fit the calibration of a unit to labelled presses.

    Args:
        frames: The dataset, with the forces on the protrusions.
        episodes: Numbers of the presses.

    Raises:
        FormatError: If the dataset does not say the forces.
        UsageError: If no press touches, the skin is flat, or two channels are swapped.
    """
    if frames.taxel_force is None:
        raise FormatError(
            f"{frames.origin} does not say the forces on the protrusions",
            "the column tacdata.taxel_force",
            "label the recordings again and pack them",
        )
    presses = []
    for span in frames.spans(episodes):
        indices = np.arange(span.start, span.stop)
        force = np.asarray(frames.taxel_force[span.start : span.stop], float)
        loaded = indices[frames.valid[span.start : span.stop] & (np.abs(force).max(axis=1) > 0)]
        if len(loaded):
            presses.append((np.asarray(frames.taxels[loaded], float), np.asarray(frames.taxel_force[loaded], float)))
    if not presses and not frames.sensor.skin.protrusion_radius:
        raise UsageError(
            f"{frames.origin} is of {frames.sensor.name}, a flat skin: the model knows no force on its taxels",
            "a skin with protrusions on a board, to turn readings into forces",
            "add --no-calibrate, or train another network (--network paper)",
        )
    if not presses:
        raise UsageError(
            f"{frames.origin}: none of {len(episodes)} presses touches the skin",
            "a press that loads taxels",
            "record presses deeper than 0.2 mm",
        )
    _check_order(presses, frames.origin)
    sums = _sums(presses)
    gain, error, exponent = _fitted(sums)
    variance = variance_error = 0.0
    mixing = None
    if not frames.simulated:  # those spread their loads as the model does
        variance, variance_error = _spread(presses, frames.sensor.taxels, exponent)
        mixing = spreading(frames.sensor.taxels, variance)
        gain, error = _gains(_gathered(presses, frames.sensor.taxels, variance), exponent)
    groups = min(len(presses), _GROUPS)
    # From a single press the jackknife knows no scatter: the largest plausible error.
    exponent_error = 1.0
    if groups > 1:
        group = np.arange(len(presses)) % groups
        # Jackknife over groups of presses: frames of one press share their errors.
        left_out = np.array([_fitted([part[..., group != k, :] for part in sums])[2] for k in range(groups)])
        exponent_error = _jackknifed(left_out)
    return ChannelCalibration(gain, exponent, error, exponent_error, len(presses), variance, variance_error, mixing)


def doubts(calibration: ChannelCalibration, frames: Frames, episodes: tuple[int, ...]) -> list[str]:
    """Return undetermined quantities of a calibration and the presses to record, one sentence each.

    Args:
        calibration: Result of `calibrate` found.
        frames: The dataset.
        episodes: Numbers of the presses.
    """
    words, largest = [], np.zeros(len(calibration.gain))
    for span in frames.spans(episodes):
        if frames.taxel_force is not None:
            largest = np.maximum(largest, np.abs(frames.taxel_force[span.start : span.stop]).max(axis=0, initial=0.0))
    if calibration.presses < FEWEST:
        words.append(
            f"the channels' gains rest on {calibration.presses} press{'es' if calibration.presses > 1 else ''}: they "
            f"cannot be told from what the model errs at one place; record {FEWEST} presses or more"
        )
    idle = np.flatnonzero(largest < _TOUCHED * np.median(largest[largest > 0]))
    if len(idle):
        words.append(
            f"channels hardly touched: {', '.join(map(str, idle))}; they take the mean gain; record presses over them"
        )
    if calibration.exponent_error > UNSURE:
        words.append(
            f"the exponent is {calibration.exponent:.2f} ± {calibration.exponent_error:.2f}: depths of other presses "
            "may be off; record presses of several depths, up to the deepest that you will meet"
        )
    return words


def _gathered(
    presses: list[tuple[np.ndarray, np.ndarray]], taxels: Taxels, variance: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return presses with the forces that a unit feels whose skin spreads loads less far than the model's."""
    if not variance:
        return presses
    gather = spreading(taxels, -variance).T
    return [(counts, force @ gather) for counts, force in presses]


def _spread(presses: list[tuple[np.ndarray, np.ndarray]], taxels: Taxels, exponent: float) -> tuple[float, float]:
    """Return the variance of the spreading and its standard error [mm^2].

    Gains are fitted to forces without spreading, the variance to the residual of the spread forces. The exponent
    stays that without spreading: a joint fit would trade a steeper law for a wider skin.
    """
    # `spreading` is the exponential of variance / 2 times the Laplacian: this is its derivative by the variance.
    change, variance, previous = laplacian(taxels) / 2, 0.0, 0.0
    product, square = np.zeros(len(presses)), np.zeros(len(presses))
    if len(presses) == 1:  # its place errs as much as a skin differs
        return 0.0, FARTHEST
    for _ in range(_TURNS):
        # Gains and spreading in turn: either is linear with the other given.
        gain, _ = _gains(_gathered(presses, taxels, variance), exponent)
        mixing = spreading(taxels, variance)
        for k, (counts, force) in enumerate(presses):
            spread = (_power(counts, exponent) * gain) @ mixing.T
            slope = spread @ change
            product[k], square[k] = (slope * (force - spread)).mean(), (slope * slope).mean()
        previous = variance
        variance = float(np.clip(previous + product.sum() / max(square.sum(), 1e-300), -FARTHEST, FARTHEST))
    left_out = previous + (product.sum() - product) / np.maximum(square.sum() - square, 1e-300)
    return variance, _jackknifed(left_out)


def _gains(presses: list[tuple[np.ndarray, np.ndarray]], exponent: float) -> tuple[np.ndarray, np.ndarray]:
    """Return gains and their standard errors [N], shapes (taxels,), at an exponent."""
    square, product, _ = _sums(presses, np.array([exponent]))
    return _shrunk(square[0], product[0])


def _jackknifed(left_out: np.ndarray) -> float:
    """Return the standard error of an estimate from those without one part each."""
    return float(np.sqrt((len(left_out) - 1) / len(left_out) * ((left_out - left_out.mean()) ** 2).sum()))


def _power(counts: np.ndarray, exponent: float) -> np.ndarray:
    return np.sign(counts) * (np.abs(counts) / CALIBRATION_UNIT) ** exponent


def _sums(presses: list[tuple[np.ndarray, np.ndarray]], exponents: np.ndarray = EXPONENTS) -> list[np.ndarray]:
    """Return the sums that a least-squares fit of gains needs, over the frames of each press.

    Returns:
        Squared readings and readings times forces, shapes (exponents, presses, taxels), and squared forces, shape
        (presses, taxels); readings to the power of each of the ``exponents``.
    """
    square = np.empty((len(exponents), len(presses), presses[0][0].shape[1]))
    product, total = np.empty_like(square), np.empty(square.shape[1:])
    for k, (counts, force) in enumerate(presses):
        # Each press counts the same, however many frames it has: those are correlated.
        weight = 1 / len(counts)
        total[k] = weight * (force * force).sum(axis=0)
        for j, exponent in enumerate(exponents):
            x = _power(counts, exponent)
            square[j, k], product[j, k] = weight * (x * x).sum(axis=0), weight * (x * force).sum(axis=0)
    return [square, product, total]


def _fitted(sums: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, float]:
    """Return gains and their standard errors [N], shapes (taxels,), and the exponent with the least squared error."""
    square, product, total = sums
    gains, errors = np.empty((2, len(square), square.shape[-1]))
    loss = np.empty(len(square))
    for j in range(len(square)):
        gains[j], errors[j] = _shrunk(square[j], product[j])
        loss[j] = (total - 2 * gains[j] * product[j] + gains[j] ** 2 * square[j]).sum()
    best = int(loss.argmin())
    exponent = EXPONENTS[best]
    if 0 < best < len(EXPONENTS) - 1:
        # The vertex of the parabola through the best exponent and its neighbours.
        below, center, above = loss[best - 1 : best + 2]
        exponent += 0.5 * (EXPONENTS[1] - EXPONENTS[0]) * (below - above) / max(below - 2 * center + above, 1e-300)
    at = [np.array([np.interp(exponent, EXPONENTS, value) for value in values.T]) for values in (gains, errors)]
    return at[0], at[1], float(exponent)


def _shrunk(square: np.ndarray, product: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gains and their standard errors [N], shapes (taxels,): best linear unbiased predictions.

    A one-way random-effects model: a channel's gain varies about the mean, and each press's estimate about the
    channel's gain, since the model errs a little otherwise at each place. Both variances are found by moments
    (R. DerSimonian, N. Laird, Controlled Clinical Trials 7 (1986) 177).

    Args:
        square: Sums of squared readings, shape (presses, taxels): the weights of the presses' own estimates.
        product: Sums of readings times forces [N], shape (presses, taxels).
    """
    weight = square.sum(axis=0)
    mean = product.sum() / weight.sum()
    channel_gain = np.divide(product, square, out=np.full_like(square, mean), where=square > 0)
    gain = np.divide((square * channel_gain).sum(axis=0), weight, out=np.full(len(weight), mean), where=weight > 0)
    concentration = np.divide((square**2).sum(axis=0), weight, out=np.zeros_like(weight), where=weight > 0)
    degrees_of_freedom = (weight - concentration).sum()
    # Where each channel was touched by one press alone, the disagreement of two presses is unknown.
    several = degrees_of_freedom > 1e-9 * weight.sum()
    within = (square * (channel_gain - gain) ** 2).sum() / degrees_of_freedom if several else np.inf
    # Of how many equal presses a channel's estimate is worth, and how much they tell.
    count = np.divide(weight, concentration, out=np.zeros_like(weight), where=concentration > 0)
    precision = count / within if within > 0 else np.where(count > 0, 1e300, 0.0)
    sampling = np.divide(1.0, precision, out=np.zeros_like(weight), where=precision > 0)
    # Moments of a random-effects model: scatter of the channels less what sampling alone explains.
    excess = (weight * ((gain - mean) ** 2 - sampling)).sum() / weight.sum()
    between = max(float(excess), 0.0) if several else 0.0
    reliability = between * precision / (1.0 + between * precision)
    # The statement of the error allows a spread that few presses cannot tell.
    error = np.sqrt(1.0 / (1.0 / max(between, (SPREAD * mean) ** 2) + precision))
    # Channels that few presses touched are drawn towards the mean gain.
    return mean + reliability * (gain - mean), error


def _check_order(presses: list[tuple[np.ndarray, np.ndarray]], origin: str) -> None:
    """Refuse channels that are swapped.

    Raises:
        UsageError: Naming the first such pair.
    """
    counts, force = (np.concatenate([press[k] for press in presses]) for k in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.nan_to_num(np.corrcoef(counts.T, force.T))
    # A channel that loads hardly reach shows their time course alone, in which all channels are alike.
    sizes = [np.abs(part).max(axis=0) for _, part in presses]
    loaded = np.any([size > _LOADED * size.max() for size in sizes], axis=0)
    crossed = correlation[: counts.shape[1], counts.shape[1] :] * loaded[:, None]
    diagonal = np.diag(crossed)
    for k in range(len(diagonal)):
        j = int(crossed[k].argmax())
        if j > k and crossed[k, j] > diagonal[k] + _SWAPPED and crossed[j, k] > diagonal[j] + _SWAPPED:
            raise UsageError(
                f"{origin}: channel {k} reads what channel {j} should, and channel {j} what channel {k} should "
                f"(correlation with the model's forces {crossed[k, j]:.2f} and {crossed[j, k]:.2f})",
                "channels in the order of the sensor file",
                "correct the wiring or the order, and record again",
            )
