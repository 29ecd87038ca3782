"""Sensor, tools, positions and depths of recorded presses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.errors import FormatError, UsageError
from tacdata.recording import Episode, read_episode, read_session
from tacdata.sensor import Sensor
from tacdata.surrogate.grid import Reach
from tacdata.surrogate.symmetry import round_about_axis

_DESCRIBED = ("sensor", "indenter", "contact")
"""Facts that the user must have stated to an import, not assumed, before its presses are solved."""


@dataclass(frozen=True)
class Pressed:
    """Everything that was pressed into one sensor."""

    sensor: Sensor
    reaches: dict[str, Reach]
    """Name of each tool, with its positions and depths."""
    places: tuple[tuple[str, np.ndarray, float], ...]
    """Tool, x and y [mm], shape (2,), and depth [mm] of every press with contact."""


def unmodelled(episode: Episode) -> str:
    """Return why a recording's sensor has no finite-element model, as a sentence; empty if it has one."""
    stand_ins = [text.split(":")[0] for text in episode.rig.get("imported", {}).get("stand_ins", [])]
    # A guessed rate or plan changes no press; a guessed shape does.
    made_up = [name for name in stand_ins if name.split("/")[0] in _DESCRIBED]
    if made_up:
        return f"imported without {', '.join(made_up)}"
    return "" if episode.sensor.transduction else "its sensor file says nothing of its transduction"


def pressed(paths: list[Path]) -> Pressed:
    """Read the presses of recordings.

    Args:
        paths: Recordings, or folders of sessions.

    Raises:
        UsageError: If nothing touches the sensor, or a path is neither.
        FormatError: If sensors differ, have no model, or one tool was mounted in several ways that matter.
    """
    sensor: Sensor | None = None
    episodes_of: dict[str, list[tuple[Episode, np.ndarray]]] = {}
    for file in (file for path in paths for file in _files(path)):
        episode = read_episode(file)
        if why := unmodelled(episode):
            raise FormatError(
                f"{file}: no finite-element model of this sensor: {why}",
                "a sensor and indenters that are described",
                "start from a fitted response (no --fem), or import with sensor file, indenter and height of contact",
            )
        if sensor is not None and episode.sensor.content_hash != sensor.content_hash:
            fault = f"{file}: another sensor than the recordings before"
            raise FormatError(fault, "recordings of one sensor", "run it alone")
        sensor = episode.sensor
        touching = episode.tip[episode.tip[:, 2] > 0]
        if len(touching):
            # By the plan's name: two specimens of one shape stay apart.
            episodes_of.setdefault(episode.press.indenter_name, []).append((episode, touching))
    if sensor is None or not episodes_of:
        raise UsageError("no recording touches the sensor", "presses with a depth above 0", "record presses")
    places = tuple(
        (name, t[np.argmax(t[:, 2]), :2], float(t[:, 2].max())) for name, e in episodes_of.items() for _, t in e
    )
    return Pressed(sensor, {name: _reach(name, episodes) for name, episodes in episodes_of.items()}, places)


def _reach(name: str, episodes: list[tuple[Episode, np.ndarray]]) -> Reach:
    first = episodes[0][0].press
    round_one = round_about_axis(first.indenter)
    # The yaw of a round tool changes nothing, so that its recordings may differ in it.
    ways = {
        (0.0 if round_one else round(p.yaw, 3), p.tilt_x, p.tilt_y): p.turned for p in (e.press for e, _ in episodes)
    }
    if len(ways) > 1:
        raise FormatError(
            f"{name} mounted at {'; '.join(ways[way] for way in sorted(ways))}",
            "one way for each name",
            "run them one at a time, or give each its own name in the plan",
        )
    [(yaw, *tilt)] = ways
    tips = np.concatenate([t for _, t in episodes])
    low, high = tips[:, :2].min(axis=0), tips[:, :2].max(axis=0)
    return Reach(
        first.indenter,
        yaw,
        (float(low[0]), float(low[1])),
        (float(high[0]), float(high[1])),
        float(tips[:, 2].max()),
        (tilt[0], tilt[1]),
    )


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return list(read_session(path).episodes)
    if not path.is_file():
        raise UsageError(f"no file or folder {path}", "a recording (.mcap) or a session's folder", "check the path")
    return [path]
