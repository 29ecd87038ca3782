"""A press that has no label, as a picture: its place, its depth, and the model's error."""

from __future__ import annotations

import io
import textwrap
from pathlib import Path

import numpy as np

from tacdata.recording.episode import Episode

WIDTH = 110
"""Letters a line of the reason."""
LINES = 6
"""Lines of the reason at most."""
MARGIN = 1.0
"""Room around the skin [mm]."""


def failed_press(recording: Path, reason: str) -> bytes:
    """Draw the press of a recording on its skin, its depth over time, and why it has no label; return a PNG.

    Raises:
        UsageError: If there is no such recording.
        FormatError: If it is damaged.
    """
    from matplotlib.figure import Figure

    from tacdata.recording.files.reader import read_episode

    episode = read_episode(recording)
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    place, course = figure.subplots(1, 2, width_ratios=[1, 1.6])
    _place(place, episode)
    _course(course, episode)
    lines = [line for part in reason.splitlines() for line in textwrap.wrap(part, WIDTH)][:LINES]
    figure.suptitle(f"{recording.name}: no label", x=0.01, ha="left", fontweight="bold")
    figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize=8, color="#a02c1c", family="monospace")
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def _place(axes, episode: Episode) -> None:
    """The skin from above with its taxels, and the indenter's outline where it touched."""
    skin, press = episode.sensor.skin, episode.press
    x, y = skin.size_x / 2, skin.size_y / 2
    axes.plot([-x, x, x, -x, -x], [-y, -y, y, y, -y], color="#555555", lw=1)
    centers = episode.sensor.taxels.centers
    axes.scatter(centers[:, 0], centers[:, 1], marker="s", s=14, color="#b7c4d2", label="taxels")
    span = np.linspace(-max(x, y), max(x, y), 241)
    grid_x, grid_y = np.meshgrid(span, span, indexing="ij")
    height = press.indenter.profile(grid_x, grid_y)
    turn = np.radians(press.yaw)
    at_x = press.x + grid_x * np.cos(turn) - grid_y * np.sin(turn)
    at_y = press.y + grid_x * np.sin(turn) + grid_y * np.cos(turn)
    levels = [level for level in (press.depth / 3, press.depth) if np.nanmin(height) < level < np.nanmax(height)]
    if levels:
        axes.contour(at_x, at_y, np.nan_to_num(height, nan=1e9, posinf=1e9), levels=levels, colors="#c2412d")
    axes.plot([press.x], [press.y], "+", color="#c2412d", ms=10, label=f"{press.indenter_name}, as deep as planned")
    axes.set(
        xlim=(-x - MARGIN, x + MARGIN),
        ylim=(-y - MARGIN, y + MARGIN),
        aspect="equal",
        xlabel="x [mm]",
        ylabel="y [mm]",
        title=f"({press.x:g}, {press.y:g}) mm, yaw {press.yaw:g}°",
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=8, frameon=False)


def _course(axes, episode: Episode) -> None:
    """The tip's depth over time, and the strongest change of a reading."""
    begin = episode.tip_ns[0]
    axes.plot((episode.tip_ns - begin) / 1e9, episode.tip[:, 2], color="#2f6fb0")
    axes.axhline(0, color="#999999", lw=0.8)
    axes.axhline(episode.press.depth, color="#c2412d", lw=0.8, ls=":")
    axes.set(xlabel="time [s]", ylabel="depth of the tip [mm]", title=f"planned: {episode.press.depth:g} mm")
    change = np.abs(episode.taxels.counts - np.median(episode.taxels.counts[:10], axis=0)).max(axis=1)
    twin = axes.twinx()
    twin.plot((episode.taxels.sample_ns - begin) / 1e9, change, color="#7a7a7a", lw=0.8)
    twin.set_ylabel("largest change of a reading [counts]", color="#7a7a7a")
