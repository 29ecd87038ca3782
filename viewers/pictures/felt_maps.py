"""Each finger's predicted depth map in a film, below each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.replay.targets import FingertipTargets
from tacdata.viewers.parts.maps import DEPTH_FLOOR
from tacdata.viewers.scene.color_scale import scale_of


class FeltMaps:
    """The maps of the demonstration that is replayed; nothing for targets without predicted depth."""

    def __init__(self, figure: Any, targets: FingertipTargets) -> None:
        """Draw the first row of each finger's map into a figure or a part of one."""
        self._maps: list[np.ndarray] = []
        self._images: list[Any] = []
        self._titles: list[Any] = []
        self._gap, self._names = [], []
        demonstration = targets.source
        felt = [n for n in targets.fingers if demonstration is not None and demonstration.tracks[n].depth is not None]
        if demonstration is None or not felt:
            return
        maps = {name: np.nan_to_num(np.asarray(demonstration.tracks[name].depth)[targets.rows]) for name in felt}
        scale = scale_of(np.array([max(float(m.max()) for m in maps.values())]), "mm", floor=DEPTH_FLOOR)
        axes = figure.subplots(len(felt), 1, squeeze=False)[:, 0]
        for panel, name in zip(axes, felt, strict=True):
            grid = demonstration.sensors[name].map
            image = panel.imshow(
                maps[name][0].T,
                origin="lower",
                cmap=scale.colormap,
                vmin=scale.low,
                vmax=scale.high,
                extent=(grid.x[0], grid.x[-1], grid.y[0], grid.y[-1]),
            )
            panel.tick_params(labelsize=7)
            panel.set_ylabel("y [mm]", fontsize=8)
            self._maps.append(maps[name])
            self._images.append(image)
            self._names.append(name)
            self._titles.append(panel.set_title(name, fontsize=9))
            self._gap.append(targets.gap[:, targets.fingers.index(name)])
        axes[-1].set_xlabel("x [mm]", fontsize=8)
        bar = figure.colorbar(self._images[0], ax=axes.tolist(), location="bottom", shrink=0.9)
        bar.set_label("predicted depth [mm]", fontsize=8)
        bar.ax.tick_params(labelsize=7)

    def show(self, row: int) -> None:
        """Show the maps of a row; a finger whose path is bridged there is marked."""
        for image, title, name, maps, gap in zip(
            self._images, self._titles, self._names, self._maps, self._gap, strict=True
        ):
            image.set_data(maps[row].T)
            title.set_text(f"{name}: path bridged" if gap[row] else name)
            title.set_color("crimson" if gap[row] else "black")
