"""Figures of a unit's visits: gains over time, gains over the array, noise, zero and loop."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tacdata.health.comparison import OWN
from tacdata.health.estimate import UncertainValue
from tacdata.health.gains import GainFit
from tacdata.health.history import History
from tacdata.pages import Band, PixelMap, Plot, Series

COMMON = "all channels"


def figures(history: History) -> list[Any]:
    """Return the figures, in their order."""
    unit = history.last.unit
    noise = _series(history, "noise", lambda k: [s.value for s in history.visits[k].noise.values()], f"noise [{unit}]")
    zero = _series(history, "zero", lambda k: _moved(history, k), f"zero less the first [{unit}]")
    known = [_gains(history), _channels(history)] if any(reference(history)[1]) else []
    made = [*known, noise, zero, *_loop(history)]
    return [*made, _array(history)] if known and reference(history)[1][-1] else made


def reference(history: History) -> tuple[str, list[GainFit | None]]:
    """Return the reference of the drawn gains, and the gains of each visit: the first visit, or the model if alone."""
    comparisons = [history.beside_first(k) for k in range(len(history.visits))]
    fits = [c.gains if c else None for c in comparisons]
    if any(fits):
        return f"first visit, {history.visits[0].name}", fits
    return "the model", list(history.model)


def _names(history: History) -> list[str]:
    return [visit.name for visit in history.visits]


def _channel_series(channel: int, values: list[float], bad: bool) -> Series:
    color, width = ("vermilion", 2.0) if bad else ("grey", 1.0)
    return Series(f"channel {channel}", values, color, "both", width=width)


def _interval_series(name: str, estimates: list[UncertainValue | None], color: str, factor: float = 1.0) -> Series:
    values = [factor * e.value if e else np.nan for e in estimates]
    low, high = (
        [factor * e.interval[side] if e and np.isfinite(e.interval[side]) else np.nan for e in estimates]
        for side in (0, 1)
    )
    return Series(name, values, color, "both", low=low, high=high, width=2.5)


def _gains(history: History) -> Plot:
    """Return the gain of every channel over the visits, and the common one with its interval."""
    name, fits = reference(history)
    bad, start = set(_marked(history)), 1.0 if fits[0] is None else np.nan
    series = []
    for channel in sorted({c for fit in fits if fit for c in fit.channels}):
        line = [fit.channels[channel].value if fit and channel in fit.channels else np.nan for fit in fits]
        series.append(_channel_series(channel, [start if np.isfinite(start) else line[0], *line[1:]], channel in bad))
    series.append(_interval_series(COMMON, [fit.common if fit else None for fit in fits], "blue"))
    title = f"gain relative to the {name.removeprefix('the ')}; blue: all channels"
    return Plot(title, "visit", "gain [1]", series, np.arange(len(fits)), names=_names(history))


def _channels(history: History) -> Plot:
    """Return the latest gains over the channels with their intervals and the tolerance."""
    fit, bad = reference(history)[1][-1], set(_marked(history))
    own = fit.own if fit else {}
    series = []
    for name, color, chosen in (
        ("within tolerance", "blue", [k for k in own if k not in bad]),
        ("changed", "vermilion", [k for k in own if k in bad]),
    ):
        if chosen:
            low, high = ([100 * (own[k].interval[side] - 1) for k in chosen] for side in (0, 1))
            values = [100 * (own[k].value - 1) for k in chosen]
            series.append(Series(name, values, color, "points", chosen, low, high))
    band = Band(-100 * OWN, 100 * OWN, "tolerance")
    title = f"{history.last.name}: own gains with 95 % intervals"
    return Plot(title, "channel", "own gain less the common [%]", series, bands=[band])


def _array(history: History) -> PixelMap:
    """Return the latest gain of each taxel at its place."""
    fit, taxels = reference(history)[1][-1], history.last.sensor.taxels
    values = np.full(taxels.count, np.nan)
    for channel, gain in (fit.own if fit else {}).items():
        values[channel] = 100 * (gain.value - 1)
    limit = max(float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0, 100 * OWN)
    dead, swapped = set(history.wiring.unfit), dict(history.wiring.swapped)
    words = ["dead" if k in dead else f"{k}:{swapped[k]}" if k in swapped else str(k) for k in range(taxels.count)]
    shape = taxels.rows, taxels.columns
    return PixelMap(
        f"{history.last.name}: own gains over the array, from above",
        values.reshape(shape),
        "%",
        -limit,
        limit,
        labels=np.reshape(words, shape).tolist(),
        palette="diverging",
        aspect=taxels.pitch_y / taxels.pitch_x,
    )


def _series(history: History, quantity: str, values: Callable[[int], list[float]], label: str) -> Plot:
    """Return a quantity of every channel over the visits."""
    bad = {change.channel for _, change in history.changed if change.quantity == quantity}
    bad |= history.wiring.unfit | {channel for channel, _ in history.wiring.swapped}
    table = np.array([values(k) for k in range(len(history.visits))], float)
    series = [_channel_series(channel, table[:, channel].tolist(), channel in bad) for channel in range(table.shape[1])]
    series.append(Series("median", np.median(table, axis=1), "blue", "both", width=2.5))
    title = f"{label.split(' [')[0]}; blue: median"
    return Plot(title, "visit", label, series, np.arange(len(table)), names=_names(history))


def _moved(history: History, number: int) -> list[float]:
    first = history.visits[0].zero
    return [value.value - first[k].value for k, value in history.visits[number].zero.items()]


def _loop(history: History) -> list[Plot]:
    """Return the loop's area, and the network's error where it is known."""
    places, names = np.arange(len(history.visits)), _names(history)
    loop = _interval_series("loop", [visit.loop for visit in history.visits], "blue", 100.0)
    label = "area [% of depth times response]"
    plots = [Plot("hysteresis loop", "visit", label, [loop], places, names=names, least=0.0)]
    if history.network:
        errors = [history.network[k].mean if k in history.network else None for k in range(len(names))]
        series = _interval_series("network", errors, "vermilion")
        plots.append(
            Plot("network's error in contact", "visit", "error [mm]", [series], places, names=names, least=0.0)
        )
    return plots


def _marked(history: History) -> list[int]:
    """Return the channels whose own gain is changed."""
    return [c.channel for _, c in history.changed if c.quantity == "gain" and c.channel is not None]
