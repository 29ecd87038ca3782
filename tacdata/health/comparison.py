"""Comparison of two visits: changes beyond their tolerance, tested one by one and corrected for all tests."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tacdata.health.estimate import Spread, UncertainValue, holm, mean
from tacdata.health.gains import FEWEST, GainFit, fit_gains
from tacdata.health.network_error import NetworkError, growth
from tacdata.health.response import PressResponse
from tacdata.health.visit import Visit
from tacdata.health.wiring import Wiring, wiring

LEVEL = 0.01
"""Probability that any test of channels, or any of the unit, errs while nothing changed beyond its tolerance [1]."""
COMMON, OWN = 0.04, 0.05
"""Tolerance of the gain that all channels share, and of a channel's own relative to it [1]."""
ZERO, DRIFT = 0.05, 0.02
"""Tolerance of a channel's zero, and of its drift in a minute: shares of its strongest response [1]."""
NOISE = 1.5
"""Tolerance of noise, as a ratio [1]."""
LOOP = 0.03
"""Tolerance of the loop's area [1]."""
REPEATABLE = 0.02
"""Tolerance of the relative standard deviation of a press repeated [1]."""
DEPTH, SIDEWAYS = 0.06, 0.3
"""Tolerance of the tip's place at the same commanded press: in depth and sideways [mm]."""
NETWORK = 0.15
"""Tolerance of the growth of a network's error [1]."""


@dataclass(frozen=True)
class Change:
    """One quantity of a visit and of an earlier one, with its test."""

    quantity: str
    """One of: common gain, gain, zero, drift, noise, loop, repeatability, depth, x, y, network error."""
    channel: int | None
    """Channel; None if it concerns all."""
    value: float
    low: float
    high: float
    """Bounds of its interval at 95 %."""
    unit: str
    tolerance: float
    p: float
    """p-value of "it is within its tolerance"."""
    corrected: float = 1.0
    """p-value corrected for all tests of the visit that concern channels, or the unit, by Holm's method."""

    @property
    def changed(self) -> bool:
        """Whether it is beyond its tolerance, by the corrected test."""
        return self.corrected < LEVEL


@dataclass(frozen=True)
class VisitComparison:
    """A visit compared with an earlier one."""

    against: int
    """Number of the earlier visit, from 0."""
    pairs: tuple[tuple[int, int], ...]
    """Places of the same press in this visit's responses, and in the earlier one's."""
    gains: GainFit | None
    wiring: Wiring
    changes: tuple[Change, ...]


def matched(later: Visit, earlier: Visit) -> list[tuple[int, int]]:
    """Return the presses that both visits hold: same indenter, place, depth and speed, the nth time with the nth."""
    places: dict[Any, list[int]] = defaultdict(list)
    for k, press in enumerate(earlier.responses):
        places[press.key].append(k)
    pairs = []
    for k, press in enumerate(later.responses):
        if places[press.key]:
            pairs.append((k, places[press.key].pop(0)))
    return pairs


def compare(
    later: Visit, earlier: Visit, against: int, network: tuple[NetworkError, NetworkError] | None = None
) -> VisitComparison:
    """Compare a visit with an earlier one.

    Args:
        later: The visit.
        earlier: The earlier one.
        against: Its number.
        network: Errors of one network at both.
    """
    pairs = matched(later, earlier)
    # Different presses with labels can be compared, too: both gains are relative to the model.
    enough = len(pairs) >= FEWEST
    measured = [later.responses[a] for a, _ in pairs]
    reference = [earlier.responses[b] for _, b in pairs]
    faults = wiring([later.entries[a] for a, _ in pairs], measured, reference) if enough else wiring_alone(later)
    order = _order(faults, len(later.noise))
    gains = _gains(measured, reference, later, earlier, faults, order) if enough else _by_labels(later, earlier, faults)
    changes = [*_gain_changes(gains), *_channel_changes(later, earlier, faults, order)]
    if enough:
        loops = np.array([a.loop - b.loop for a, b in zip(measured, reference, strict=True)])
        changes.append(_change("loop", None, mean(loops), "1", LOOP))
    if network and (
        grown := growth(
            *network, [(later.responses[a].press.index, earlier.responses[b].press.index) for a, b in pairs]
        )
    ):
        change = _change("network error", None, grown, "1", float(np.log1p(NETWORK)))
        # The test is of the logarithm; a person reads the share.
        value, low, high = (float(np.expm1(v)) for v in (change.value, change.low, change.high))
        changes.append(replace(change, value=value, low=low, high=high, tolerance=NETWORK))
    return VisitComparison(against, tuple(pairs), gains, faults, tuple(changes))


def wiring_alone(visit: Visit) -> Wiring:
    """Return the wiring of a single visit: compared with predictions if it is labelled, else with a round pattern."""
    return wiring(list(visit.entries), visit.responses, visit.predicted or None)


def corrected(comparisons: Sequence[VisitComparison]) -> tuple[VisitComparison, ...]:
    """Return a visit's comparisons with p-values corrected: all tests of channels together, all of the unit together.

    Two families, as a channel is one of many and the unit is one.
    """
    changes = [change for c in comparisons for change in c.changes]
    p_values = np.ones(len(changes))
    for of_channel in (True, False):
        rows = [k for k, change in enumerate(changes) if (change.channel is not None) == of_channel]
        p_values[rows] = holm([changes[k].p for k in rows])
    remaining = iter(p_values.tolist())
    return tuple(
        replace(c, changes=tuple(replace(x, corrected=next(remaining)) for x in c.changes)) for c in comparisons
    )


def _order(faults: Wiring, count: int) -> np.ndarray:
    """Return the channel of each taxel, shape (taxels,)."""
    order = np.arange(count)
    for channel, taxel in faults.swapped:
        order[taxel] = channel
    return order


def _gains(
    measured: Sequence[PressResponse],
    reference: Sequence[PressResponse],
    later: Visit,
    earlier: Visit,
    faults: Wiring,
    order: np.ndarray,
) -> GainFit | None:
    noise = np.array([max(later.noise[order[k]].value, spread.value) for k, spread in earlier.noise.items()])
    sorted_back = [replace(p, levels=p.levels[:, order], slope=p.slope[:, order]) for p in measured]
    return fit_gains(reference, sorted_back, noise, later.sensor, faults.unfit)


def _by_labels(later: Visit, earlier: Visit, faults: Wiring) -> GainFit | None:
    """Return the ratio of both visits' gains relative to the model; None unless both are labelled."""
    later_gains, earlier_gains = model_gains(later, faults), model_gains(earlier, wiring_alone(earlier))
    if later_gains is None or earlier_gains is None:
        return None
    ratio = {
        k: _ratio(e, earlier_gains.channels[k]) for k, e in later_gains.channels.items() if k in earlier_gains.channels
    }
    ratios = {k: _ratio(e, earlier_gains.own[k]) for k, e in later_gains.own.items() if k in earlier_gains.own}
    common, presses = _ratio(later_gains.common, earlier_gains.common), min(later_gains.presses, earlier_gains.presses)
    return GainFit(ratio, common, ratios, {}, presses)


def model_gains(visit: Visit, faults: Wiring) -> GainFit | None:
    """Return the gains of a labelled visit relative to the model's predictions; None without labels."""
    if not visit.predicted:
        return None
    order = _order(faults, len(visit.noise))
    noise = np.array([visit.noise[k].value for k in order.tolist()])
    sorted_back = [replace(p, levels=p.levels[:, order], slope=p.slope[:, order]) for p in visit.responses]
    return fit_gains(visit.predicted, sorted_back, noise, visit.sensor, faults.unfit, predicted=True)


def _ratio(numerator: UncertainValue, denominator: UncertainValue) -> UncertainValue:
    value = numerator.value / denominator.value
    error = abs(value) * float(np.hypot(numerator.error / numerator.value, denominator.error / denominator.value))
    return UncertainValue(value, error, min(numerator.freedom, denominator.freedom))


def _gain_changes(gains: GainFit | None) -> list[Change]:
    if gains is None:
        return []
    changes = [_change("common gain", None, _less_one(gains.common), "1", COMMON)]
    changes += [_change("gain", k, _less_one(e), "1", OWN) for k, e in gains.own.items()]
    limits = {"depth": DEPTH, "x": SIDEWAYS, "y": SIDEWAYS}
    return changes + [_change(name, None, e, "mm", limits[name]) for name, e in gains.shift.items()]


def _less_one(gain: UncertainValue) -> UncertainValue:
    return replace(gain, value=gain.value - 1.0)


def _channel_changes(later: Visit, earlier: Visit, faults: Wiring, order: np.ndarray) -> list[Change]:
    """Return the changes of noise, zero and drift of each channel, and of the repeatability of a press."""
    strongest = np.max([np.abs(press.hold) for press in earlier.responses], axis=0)
    zero, noise, drift, earlier_zero, noisy = later.zero, later.noise, later.drift, earlier.zero, earlier.noise
    changes = []
    for taxel, channel in enumerate(order.tolist()):
        if channel in faults.unfit or not strongest[taxel] > 0:
            continue
        now, then = zero[channel], earlier_zero[taxel]
        error, freedom = float(np.hypot(now.error, then.error)), min(now.freedom, then.freedom)
        shift = UncertainValue(now.value - then.value, error, freedom)
        changes.append(_change("zero", channel, shift, later.unit, ZERO * float(strongest[taxel])))
        changes.append(_change("drift", channel, drift[channel], f"{later.unit}/min", DRIFT * float(strongest[taxel])))
        changes.append(_louder(channel, noise[channel], noisy[taxel]))
    return [*changes, *repeatability_changes(later)]


def repeatability_changes(visit: Visit) -> list[Change]:
    """Return the test of a visit's repeatability, which needs no other visit; empty without a press repeated."""
    repeated = visit.repeatability
    if repeated is None:
        return []
    low, high = repeated.interval
    p = repeated.p_above(REPEATABLE)
    return [Change("repeatability", None, repeated.value, low, high, "1", REPEATABLE, p, p)]


def _louder(channel: int, later: Spread, earlier: Spread) -> Change:
    """Return the ratio of two noises, with the bounds of F."""
    ratio = later.value / max(earlier.value, 1e-9)
    (low, high), (earlier_low, earlier_high) = later.interval, earlier.interval
    half = 0.0
    if earlier.value > 0 and later.value > 0:
        half = np.hypot(np.log(high / low), np.log(earlier_high / earlier_low)) / 2
    p = later.p_louder(earlier, NOISE)
    return Change("noise", channel, ratio, ratio * float(np.exp(-half)), ratio * float(np.exp(half)), "1", NOISE, p)


def _change(quantity: str, channel: int | None, estimate: UncertainValue, unit: str, tolerance: float) -> Change:
    low, high = map(float, estimate.interval)
    return Change(quantity, channel, float(estimate.value), low, high, unit, tolerance, estimate.p_beyond(tolerance))
