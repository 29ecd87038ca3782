"""A finished label as a small picture."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from tacdata.labels import Label, read_label
from tacdata.labels.table import read_header

SCALE = 6
"""Picture points a pixel of the map."""
STOPS = np.array([[13, 22, 48], [35, 74, 140], [33, 145, 140], [122, 209, 81], [253, 231, 37]], dtype=float)
"""Colours from no depth to the deepest."""


def deepest_frame(label: Label) -> int:
    """Return the number of the frame whose map is deepest."""
    return int(label.depth.reshape(len(label.time_ns), -1).max(axis=1).argmax())


def account(path: Path) -> str:
    """Return the provenance and the error of a label, from its file: one line a fact.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is damaged.
    """
    stamp = read_header(path)["provenance"]
    solver = stamp["parameters"].get("solver") or {}
    parameters = solver.get("parameters", {})
    job = stamp["parameters"].get("job") or {}
    lines = [f"label made {stamp['made_at']} by {stamp['made_by']} {stamp['code_version']}"]
    if solver:
        lines.append(
            f"press solved {solver.get('made_at', '')} by worker {solver.get('worker', '?')} in "
            f"{solver.get('seconds', float('nan')):.1f} s, on {parameters.get('device', '?')}"
        )
    else:
        lines.append("no press was solved: the indenter never touches")
    if job:
        shape = ", ".join(f"{key} {value}" for key, value in job["indenter"].items())
        lines.append(f"indenter {shape} at ({job['x']:g}, {job['y']:g}) mm, yaw {job['yaw']:g} deg")
        lines.append(f"{len(job['depths'])} states, deepest {max(job['depths']):g} mm")
    if "newton" in parameters:
        steps = " ".join(map(str, np.ravel(parameters["newton"])))
        lines.append(f"law {parameters.get('law', '?')}; Newton steps a state: {steps}")
    lines += _quality(read_label(path))
    parents = stamp["parents"]
    lines += [f"{name} {parents[name]}" for name in ("recording", "model", "solution") if parents.get(name)]
    return "\n".join(lines)


def _quality(label: Label) -> list[str]:
    lines = [f"{len(label.time_ns)} frames, error at most {1000 * np.nanmax(label.error):.1f} um"]
    if label.uncertainty is not None:
        lines.append(f"standard deviation at most {1000 * np.nanmax(label.uncertainty):.1f} um")
    return lines


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
    # Rows of a picture run from the top: y points up, as in the sensor's frame.
    place = share.T[::-1] * (len(STOPS) - 1)
    channels = [np.interp(place, np.arange(len(STOPS)), STOPS[:, k]) for k in range(3)]
    values = np.stack(channels, axis=-1).astype(np.uint8)
    image = Image.fromarray(values).resize((values.shape[1] * SCALE, values.shape[0] * SCALE), Image.Resampling.NEAREST)
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue(), top
