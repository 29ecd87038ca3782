"""One page: readings before and after, the gap by group, the labels."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.revision.evidence.curves import EpisodeCurves
from tacdata.revision.evidence.gap import GapReduction, ResidualChange

BEFORE, AFTER, MEASURED = "#d55e00", "#0072b2", "#000000"
"""Okabe and Ito's vermilion and blue, which colour-blind people can tell apart."""

TITLE = 130
"""Characters of a line of the title."""


def draw(
    title: str,
    episodes: Sequence[EpisodeCurves],
    gap: GapReduction,
    path: Path,
    networks: Sequence[dict[str, Any]] = (),
) -> None:
    """Draw the page into a PNG file.

    Args:
        title: Its title.
        episodes: Episodes, at most three.
        gap: The gap.
        path: File to write.
        networks: Metrics of networks before and after (`tacdata.revision.labels.retrain`), if any were trained.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tacdata.viewers.output_file import written_beside
    from tacdata.viewers.pictures.backend import STYLE

    with rc_context(STYLE):
        figure = Figure(figsize=(13.0, 7.6), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle("\n".join(textwrap.wrap(title, TITLE)), fontsize=12)
        halves: Any = figure.subfigures(2, 1)
        upper, lower = halves
        top: Any = np.atleast_1d(upper.subplots(1, max(len(episodes), 1)))
        bottom: Any = lower.subplots(1, 3 if networks else 2)
        for k, episode in enumerate(episodes):
            _curves(top[k], episode, k == 0)
        _residuals(bottom[0], episodes)
        _groups(bottom[1], gap)
        if networks:
            _networks(bottom[2], networks)
        with written_beside(path) as temporary:
            figure.savefig(temporary, dpi=110)


def _curves(axis: Any, episode: EpisodeCurves, legend: bool) -> None:
    c = episode.channel
    axis.plot(episode.time, episode.measured[:, c], ".", ms=3, color=MEASURED, label="measured")
    axis.plot(episode.time, episode.before[:, c], color=BEFORE, lw=1.2, label="model before")
    axis.plot(episode.time, episode.after[:, c], color=AFTER, lw=1.2, label="model after")
    axis.set(title=f"{episode.name}, {episode.channel_name}", xlabel="time [s]", ylabel="reading")
    if legend:
        axis.legend(loc="best")


def _residuals(axis: Any, episodes: Sequence[EpisodeCurves]) -> None:
    axis.axhspan(-2, 2, color="0.9", zorder=0, label="noise, two standard deviations")
    at = 0.0
    for k, episode in enumerate(episodes):
        c = episode.channel
        for predicted, color, name in ((episode.before, BEFORE, "before"), (episode.after, AFTER, "after")):
            wrong = (episode.measured[:, c] - predicted[:, c]) / episode.noise[c]
            axis.plot(episode.time + at, wrong, color=color, lw=1.0, label=name if k == 0 else None)
        at += float(episode.time[-1]) + 0.5
    axis.set(title="what the model leaves, in the same episodes", xlabel="time [s]", ylabel="residual / noise")
    axis.legend(loc="best", fontsize=8)


def _groups(axis: Any, gap: GapReduction) -> None:
    rows: list[ResidualChange] = [gap.total, *gap.elsewhere]
    where = np.arange(len(rows))
    axis.barh(where - 0.2, [c.before for c in rows], 0.38, color=BEFORE, label="before")
    axis.barh(where + 0.2, [c.after for c in rows], 0.38, color=AFTER, label="after")
    axis.axvline(1.0, color="k", lw=0.8)
    names = [c.name if k == 0 else f"{c.name}, left out" for k, c in enumerate(rows)]
    axis.set_yticks(where, [f"{n} ({c.episodes})" for n, c in zip(names, rows, strict=True)], fontsize=8)
    axis.invert_yaxis()
    low = min(0.8, *(c.after for c in rows))
    axis.set(
        xscale="log",
        xlim=(0.8 * low, None),
        xlabel="mean square of the residual; 1 is the noise floor",
        title="the gap, where the parameters were not fitted",
    )
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=8)  # above every bar


def _networks(axis: Any, metrics: Sequence[dict[str, Any]]) -> None:
    """Draw each metric after over before: they have different units."""
    comparable = [m for m in metrics if m["before"] and m["after"] is not None]
    where = np.arange(len(comparable))
    axis.barh(where, [m["after"] / m["before"] for m in comparable], 0.6, color=AFTER)
    axis.axvline(1.0, color=BEFORE, lw=1.5)
    for at, m in zip(where, comparable, strict=True):
        axis.text(0.02, at, f"{m['before']:.3g} → {m['after']:.3g} {m['unit']}", va="center", fontsize=8, color="white")
    axis.set_yticks(where, [m["title"].partition(",")[0] for m in comparable], fontsize=8)
    axis.invert_yaxis()
    axis.set(xlim=(0, None), xlabel="after / before", title="a network trained before and after")
