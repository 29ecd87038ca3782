"""Each finger's predicted depth map in a film, below each other."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from tacdata.viewers.scene.color_scale import ColorScale

Felt = Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Finger -> its maps [mm], shape (n, pixels_x, pixels_y), and the places of their pixels along x and y [mm]."""


class FeltMaps:
    """The maps of every finger that has any."""

    def __init__(self, figure: Any, felt: Felt, scale: ColorScale) -> None:
        """Draw the first map of each finger into a figure or a part of one."""
        self._felt = felt
        self._images: list[Any] = []
        self.titles: list[Any] = []
        """Titles of the panels: the finger, and whether its path is bridged."""
        if not felt:
            return
        axes = figure.subplots(len(felt), 1, squeeze=False)[:, 0]
        for panel, (name, (maps, x, y)) in zip(axes, felt.items(), strict=True):
            limits = {"cmap": scale.colormap, "vmin": scale.low, "vmax": scale.high}
            self._images.append(panel.imshow(maps[0].T, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), **limits))
            self.titles.append(panel.set_title(name, fontsize=9))
            panel.tick_params(labelsize=7)
            panel.set_ylabel("y [mm]", fontsize=8)
        axes[-1].set_xlabel("x [mm]", fontsize=8)
        bar = figure.colorbar(self._images[0], ax=axes.tolist(), location="bottom", shrink=0.9)
        bar.set_label("predicted depth [mm]", fontsize=8)
        bar.ax.tick_params(labelsize=7)

    def show(self, rows: Mapping[str, int], bridged: Collection[str]) -> None:
        """Show a row of each finger's maps; fingers whose path is bridged there are marked."""
        for image, title, (name, (maps, _, _)) in zip(self._images, self.titles, self._felt.items(), strict=True):
            image.set_data(maps[rows[name]].T)
            title.set_text(f"{name}: path bridged" if name in bridged else name)
            title.set_color("crimson" if name in bridged else "black")
