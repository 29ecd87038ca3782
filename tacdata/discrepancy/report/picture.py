"""One picture: the residual before and after, its place, the probabilities."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.discrepancy.data.streams import Streams
from tacdata.discrepancy.heading import origin, sentence, sizes
from tacdata.discrepancy.report.conclusion import Conclusion, Fit
from tacdata.discrepancy.report.residual_slices import Slice, whitened_residual
from tacdata.effects import load

MOST_ROWS = 1200
"""Rows drawn of the worst episodes."""

TITLE_WIDTH = 120
"""Characters in a line of the title."""


MOST_BARS = 12
"""Mechanisms with a bar, the most probable first."""


def draw(conclusion: Conclusion, base: list[Slice], final: list[Slice], verdict: dict[str, Any], path: Path) -> None:
    """Draw the picture into a PNG file."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(12, 8), constrained_layout=True)
    head = [f"{verdict['status']}: {sentence(verdict['why'])[0]}", *sizes(verdict), origin(verdict)]
    title = "\n".join(textwrap.fill(line, TITLE_WIDTH) for line in head if line)
    figure.suptitle(title, fontsize=11)
    added = bool(verdict["effects"])  # without an effect there is no after
    fits = conclusion.before, conclusion.after
    if fits[0] is not None and fits[1] is not None:
        _streams(axes[0, 0], (fits[0], fits[1]), added)
        _episodes(axes[1, 1], (fits[0], fits[1]), added)
    _slices(axes[0, 1], base, final, added)
    _probabilities(axes[1, 0], conclusion)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _streams(axis: Any, fits: tuple[Fit, Fit], added: bool) -> None:
    course = fits[0].problem.setting.course.reduced
    first, last = (whitened_residual(fit.problem) for fit in fits)
    power = np.square(first).mean(axis=1)
    # Sealed episodes have no rows here.
    read = np.unique(course.episode)
    worst = read[np.argsort([-power[course.episode == e].mean() for e in read])[:3]]
    stream = int(np.argmax(np.square(first).mean(axis=0)))
    at = 0.0
    for number, e in enumerate(worst):
        rows = np.flatnonzero(course.episode == e)[:MOST_ROWS]
        time = course.time[rows] - course.time[rows[0]] + at
        at = float(time[-1]) + 0.5
        axis.plot(time, first[rows, stream], color="tab:red", lw=0.8, label="before" if not number else None)
        if added:
            axis.plot(time, last[rows, stream], color="tab:blue", lw=0.8, label="after" if not number else None)
    axis.axhspan(-2, 2, color="0.9", zorder=0)
    label = Streams.of(course).names(course)[stream]
    axis.set(title=f"{label} in the three worst episodes", xlabel="time [s]", ylabel="residual / noise")
    if added:
        axis.legend()


def _slices(axis: Any, base: list[Slice], final: list[Slice], added: bool) -> None:
    if not base:  # not asked for
        axis.set_axis_off()
        return
    pairs = [(b, a) for b, a in zip(base, final, strict=True) if b.by != "stream"]
    names = [f"{b.by}: {b.name}" for b, _ in pairs]
    where = np.arange(len(pairs))
    axis.barh(where - 0.2 * added, [b.mean_square for b, _ in pairs], 0.4, color="tab:red", label="before")
    if added:
        axis.barh(where + 0.2, [a.mean_square for _, a in pairs], 0.4, color="tab:blue", label="after")
    axis.axvline(1.0, color="k", lw=0.8)
    axis.set_yticks(where, names, fontsize=7)
    axis.invert_yaxis()
    axis.set(xscale="log", xlabel="mean square over the noise floor", title="where it lives")


def _probabilities(axis: Any, conclusion: Conclusion) -> None:
    every = {
        "nothing": conclusion.nothing,
        "something without a name": conclusion.remainder,
        **{load(name).spoken: share for name, share in list(conclusion.mechanisms.items())[:MOST_BARS]},
    }
    answer = {e.placed.effect.spoken for e in conclusion.effects}
    colors = ["tab:blue" if name in answer else "0.6" for name in every]
    axis.barh(list(every), list(every.values()), color=colors)
    axis.axvline(conclusion.policy.named, color="k", lw=0.8)
    axis.invert_yaxis()
    axis.tick_params(axis="y", labelsize=7)
    axis.set(xlim=(0, 1), xlabel="probability; the line is that of a name", title="effects that may be missing")


def _episodes(axis: Any, fits: tuple[Fit, Fit], added: bool) -> None:
    floor = np.maximum(fits[0].problem.grams.rows, 1)
    axis.plot(2 * fits[0].energy / floor, "o", color="tab:red", ms=3, label="before")
    if added:
        axis.plot(2 * fits[1].energy / floor, "o", color="tab:blue", ms=3, label="after")
    axis.axhline(1.0, color="k", lw=0.8)
    axis.set(yscale="log", xlabel="episode", ylabel="mean square over the noise floor", title="every episode")
