"""A finished label as a small picture."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from tacdata.labels import Label, read_label

SCALE = 6
"""Picture points a pixel of the map."""
STOPS = np.array([[13, 22, 48], [35, 74, 140], [33, 145, 140], [122, 209, 81], [253, 231, 37]], dtype=float)
"""Colours from no depth to the deepest."""


def deepest_frame(label: Label) -> int:
    """Return the number of the frame whose map is deepest."""
    return int(label.depth.reshape(len(label.time_ns), -1).max(axis=1).argmax())


def picture(path: Path) -> tuple[bytes, float]:
    """Return the deepest frame of a label file as PNG, x to the right and y up, and its largest depth [mm].

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is damaged.
    """
    from PIL import Image

    label = read_label(path)
    depth = label.depth[deepest_frame(label)]
    top = float(depth.max())
    share = depth / top if top > 0 else depth
    place = share.T[::-1] * (len(STOPS) - 1)
    channels = [np.interp(place, np.arange(len(STOPS)), STOPS[:, k]) for k in range(3)]
    values = np.stack(channels, axis=-1).astype(np.uint8)
    image = Image.fromarray(values).resize((values.shape[1] * SCALE, values.shape[0] * SCALE), Image.Resampling.NEAREST)
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue(), top
