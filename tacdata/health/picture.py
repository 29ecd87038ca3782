"""The picture of a unit's visits: gains over time, gains over the array, noise, loop and zero."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from tacdata.health.comparison import OWN
from tacdata.health.estimate import UncertainValue
from tacdata.health.gains import GainFit
from tacdata.health.history import History

GOOD, BAD, GREY = "#1f77b4", "#d62728", "0.75"


def draw(history: History, target: Path | BinaryIO) -> None:
    """Write the picture as PNG; an older one is replaced."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 6.6), layout="constrained")
    axes: Any = figure.subplots(2, 3)
    _gains(axes[0, 0], history)
    _array(axes[0, 1], history)
    _channels(axes[0, 2], history)
    _series(
        axes[1, 0],
        history,
        "noise",
        lambda k: [s.value for s in history.visits[k].noise.values()],
        f"noise [{history.last.unit}]",
    )
    _series(axes[1, 1], history, "zero", lambda k: _moved(history, k), f"zero less the first [{history.last.unit}]")
    _loop(axes[1, 2], history)
    figure.savefig(target, dpi=100, format="png")


def reference(history: History) -> tuple[str, list[GainFit | None]]:
    """Return the reference of the drawn gains, and the gains of each visit: the first visit, or the model if alone."""
    comparisons = [history.beside_first(k) for k in range(len(history.visits))]
    fits = [c.gains if c else None for c in comparisons]
    if any(fits):
        return f"first visit, {history.visits[0].name}", fits
    return "the model", list(history.model)


def _gains(axes: Any, history: History) -> None:
    """Draw the gain of every channel over the visits, and the common one with its interval."""
    name, fits = reference(history)
    bad = set(_marked(history))
    fitted = [(k, fit) for k, fit in enumerate(fits) if fit is not None]
    if not fitted:
        _say_unknown(axes)
    start = [(0, 1.0)] if fitted and fitted[0][0] > 0 else []
    for channel in sorted({c for _, fit in fitted for c in fit.channels}):
        line = start + [(k, fit.channels[channel].value) for k, fit in fitted if channel in fit.channels]
        style = {"color": BAD, "linewidth": 1.4, "zorder": 3} if channel in bad else {"color": GREY, "linewidth": 0.8}
        axes.plot(*zip(*line, strict=True), ".-", markersize=3, **style)
        if channel in bad:
            axes.annotate(str(channel), line[-1], color=BAD, xytext=(5, -3), textcoords="offset points", fontsize=9)
    _errors(axes, [(k, fit.common) for k, fit in fitted])
    axes.set(title=f"gain beside {name}", ylabel="gain [1]")
    _visits(axes, history)


def _say_unknown(axes: Any) -> None:
    """Write into an empty panel the recordings that it needs."""
    axes.text(
        0.5, 0.5, "known from a second visit on,\nor with labels", transform=axes.transAxes, ha="center", va="center"
    )


def _errors(axes: Any, series: list[tuple[int, UncertainValue]]) -> None:
    """Draw estimates with their intervals."""
    for k, gains in series:
        low, high = gains.interval
        if np.isfinite(low):
            axes.plot([k, k], [low, high], color=GOOD, linewidth=2, zorder=4)
        axes.plot(k, gains.value, "o", color=GOOD, markersize=5, zorder=5)


def _array(axes: Any, history: History) -> None:
    """Draw the latest gain of each taxel at its place."""
    _, fits = reference(history)
    fit, taxels = fits[-1], history.last.sensor.taxels
    values = np.full(taxels.count, np.nan)
    for channel, gain in (fit.own if fit else {}).items():
        values[channel] = 100 * (gain.value - 1)
    limit = max(float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0, 100 * OWN)
    image = axes.imshow(
        values.reshape(taxels.rows, taxels.columns),
        cmap="RdBu",
        vmin=-limit,
        vmax=limit,
        origin="lower",
        aspect=taxels.pitch_y / taxels.pitch_x,
    )
    axes.figure.colorbar(image, ax=axes)
    dead, swapped = set(history.wiring.unfit), dict(history.wiring.swapped)
    for k in range(taxels.count):
        word = "dead" if k in dead else f"{k} for {swapped[k]}" if k in swapped else str(k)
        color = BAD if k in dead or k in swapped else "black"
        axes.text(k % taxels.columns, k // taxels.columns, word, ha="center", va="center", fontsize=7, color=color)
    axes.set(title=f"{history.last.name}: own gains [%], from above", xticks=[], yticks=[])


def _channels(axes: Any, history: History) -> None:
    """Draw the latest gains over the channels with their intervals and the tolerance."""
    _, fits = reference(history)
    axes.axhspan(-100 * OWN, 100 * OWN, color="0.93")
    if not fits[-1]:
        _say_unknown(axes)
    bad = set(_marked(history))
    for channel, gain in (fits[-1].own if fits[-1] else {}).items():
        low, high = (100 * (bound - 1) for bound in gain.interval)
        color = BAD if channel in bad else GOOD
        axes.plot([channel, channel], [low, high], color=color, linewidth=1.5)
        axes.plot(channel, 100 * (gain.value - 1), ".", color=color)
    axes.set(title="own gains; grey: tolerance", xlabel="channel", ylabel="beside the common gain [%]")


def _series(axes: Any, history: History, quantity: str, values: Callable[[int], list[float]], label: str) -> None:
    """Draw a quantity of every channel over the visits."""
    bad = {change.channel for _, change in history.changed if change.quantity == quantity}
    bad |= history.wiring.unfit | {channel for channel, _ in history.wiring.swapped}
    table = np.array([values(k) for k in range(len(history.visits))], float)
    for channel in range(table.shape[1]):
        color = BAD if channel in bad else GREY
        axes.plot(table[:, channel], ".-", color=color, linewidth=0.8, markersize=3, zorder=3 if channel in bad else 2)
    axes.plot(np.median(table, axis=1), "o-", color=GOOD, markersize=4, zorder=4)
    axes.set(title=f"{label.split(' [')[0]}; blue: median", ylabel=label)
    _visits(axes, history)


def _moved(history: History, number: int) -> list[float]:
    first = history.visits[0].zero
    return [value.value - first[k].value for k, value in history.visits[number].zero.items()]


def _loop(axes: Any, history: History) -> None:
    """Draw the loop's area, and the network's error where it is known."""
    series = [(k, visit.loop) for k, visit in enumerate(history.visits)]
    _errors(axes, [(k, UncertainValue(100 * e.value, 100 * e.error, e.freedom)) for k, e in series])
    axes.set(title="hysteresis loop", ylabel="area [% of depth times answer]")
    axes.set_ylim(0.0, 1.3 * axes.get_ylim()[1])
    if history.network:
        twin = axes.twinx()
        errors = sorted(history.network.items())
        twin.plot([k for k, _ in errors], [e.mean.value for _, e in errors], "s--", color=BAD, markersize=4)
        twin.set_ylabel("network's error in contact [mm]", color=BAD)
        twin.set_ylim(bottom=0.0)
    _visits(axes, history)


def _visits(axes: Any, history: History) -> None:
    names = [visit.name for visit in history.visits]
    axes.set_xticks(range(len(names)), names, rotation=20 if len(names) > 3 else 0, fontsize=8)
    axes.set_xlim(-0.4, len(names) - 0.6)


def _marked(history: History) -> list[int]:
    """Return the channels whose own gain is changed."""
    return [c.channel for _, c in history.changed if c.quantity == "gain" and c.channel is not None]
