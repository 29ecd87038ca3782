"""The deepest state of a solved case as a picture: depth map, forces of the protrusions, profile through the press."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tacdata.cases.answer import CaseAnswer


def draw(path: Path, name: str, answer: CaseAnswer) -> None:
    """Draw an answer's deepest state into a PNG file."""
    from matplotlib.figure import Figure

    deepest = int(np.argmax(answer.request.depths))
    depth, force = answer.request.depths[deepest], answer.figures.force[deepest]
    doubt = f" ± {answer.error.force[deepest]:.3f}" if answer.error else ""
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    figure.suptitle(f"{name}: {answer.request.indenter.shape}, {depth:g} mm deep, {force[2]:.3f}{doubt} N upward")
    left, middle, right = figure.subplots(1, 3)
    _map(figure, left, answer, deepest)
    _forces(figure, middle, answer, deepest)
    _profile(right, answer, deepest)
    temporary = path.with_name(f".{path.name}.partial")
    figure.savefig(temporary, dpi=120, format="png")
    temporary.replace(path)


def _map(figure: Any, axes: Any, answer: CaseAnswer, k: int) -> None:
    grid, surface = answer.model.sensor.map, answer.figures.surface[k]
    half = grid.pixel_pitch / 2
    extent = (grid.x[0] - half, grid.x[-1] + half, grid.y[0] - half, grid.y[-1] + half)
    drawn = axes.imshow(surface.T, origin="lower", extent=extent, cmap="viridis")
    axes.plot(answer.request.x, answer.request.y, "+", color="white")
    axes.axhline(answer.request.y, color="white", linewidth=0.6, linestyle=":")
    axes.set(title="depth map", xlabel="x [mm]", ylabel="y [mm]")
    figure.colorbar(drawn, ax=axes, label="undeformed minus deformed height [mm]", shrink=0.8)


def _forces(figure: Any, axes: Any, answer: CaseAnswer, k: int) -> None:
    sensor, force = answer.model.sensor, answer.figures.taxel_force[k]
    axes.set(title="forces on the protrusions", xlabel="x [mm]", ylabel="y [mm]")
    if not sensor.skin.protrusion_radius or not sensor.contact.board:
        axes.text(0.5, 0.5, "no protrusions on a board", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    x, y = sensor.taxels.centers.T
    drawn = axes.scatter(x, y, c=force, s=420, cmap="magma", vmin=0.0, edgecolors="grey")
    for place_x, place_y, value in zip(x, y, force, strict=True):
        light = value < 0.6 * force.max()
        axes.annotate(
            f"{1e3 * value:.0f}",
            (place_x, place_y),
            ha="center",
            va="center",
            fontsize=7,
            color="white" if light else "black",
        )
    axes.plot(answer.request.x, answer.request.y, "+", color="tab:blue", markersize=12)
    axes.set_aspect("equal")
    axes.margins(0.12)
    figure.colorbar(drawn, ax=axes, label="normal force [N] (figures in mN)", shrink=0.8)


def _profile(axes: Any, answer: CaseAnswer, deepest: int) -> None:
    grid = answer.model.sensor.map
    row = int(np.abs(grid.y - answer.request.y).argmin())
    for k in range(deepest + 1):
        shade = 0.25 + 0.75 * (k + 1) / (deepest + 1)
        height = -answer.figures.surface[k, :, row]
        axes.plot(grid.x, height, color="tab:blue", alpha=shade, label=f"{answer.request.depths[k]:g} mm")
        if k == deepest and answer.error:
            error = answer.error.surface[k, :, row]
            axes.fill_between(
                grid.x,
                height - error,
                height + error,
                color="tab:blue",
                alpha=0.3,
                linewidth=0,
                label="± numerical error",
            )
    axes.axvline(answer.request.x, color="grey", linewidth=0.6, linestyle=":")
    axes.set(title=f"profile at y = {grid.y[row]:g} mm", xlabel="x [mm]", ylabel="height of the outer face [mm]")
    axes.legend(fontsize=7)
