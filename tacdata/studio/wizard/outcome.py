"""Presses that a mapping gives, as figures of the page kit."""

from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import TacdataError
from tacdata.importing.mapping import Mapping, PositionEntry, TrialRule
from tacdata.importing.proposing.trial_run import TrialRun, trial_run
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_table import SourceTable, axis
from tacdata.importing.times import NEVER, times
from tacdata.pages.plot import picked
from tacdata.studio.wizard.source_preview import numbers
from tacdata.studio.wizard.table_memory import TableMemory

COLORS = ("blue", "vermilion", "green", "purple", "amber", "sky", "ink", "grey")
"""Colours of channels; more than these are not drawn."""
CUT = 0.1
"""Share of the deepest depth above which one press is separate from the next, as in a proposal [1]."""
SHOWN, POINTS, LONG = 24, 300, 2400
"""Presses that are drawn, points of each, and points of the whole path."""


def outcome(source: Path, mapping: Mapping, memory: TableMemory) -> dict[str, Any]:
    """Return the result of trying a mapping: a sentence, faults, and figures of path and presses."""
    run = trial_run(source, mapping, tables_of=memory.tables)
    return {
        "sentence": run.sentence.removeprefix("tried: "),
        "faults": list(run.faults),
        "good": bool(run.presses) and not run.faults,
        "set_aside": list(dict.fromkeys(words for press in run.presses for words in press.record["set_aside"])),
        "notes": list(dict.fromkeys(words for press in run.presses for words in press.record["notes"]))[:20],
        "path": _path(mapping, run, memory),
        "presses": [_press(press, number) for number, press in enumerate(run.presses[:SHOWN], 1)],
        "found": len(run.presses),
        "cut_above": _cut_above(mapping, run),
    }


def _cut_above(mapping: Mapping, run: TrialRun) -> float | None:
    """Return the depth [mm] that parts the presses of a recording without phases; None where it needs no such rule."""
    if mapping.trials != TrialRule() or mapping.schedule:
        return None
    deepest = max((press.press.depth for press in run.presses if not press.phases), default=0.0)
    return float(f"{CUT * deepest:.2g}") if deepest > 0 else None


def _figure(
    title: str, y: str, places: np.ndarray, series: list[dict[str, Any]], link: str = "", x: str = "time [s]"
) -> dict[str, Any]:
    return {
        "title": title,
        "x": {"label": x, "values": numbers(places)},
        "y": y,
        "series": series,
        "bands": [],
        "names": [],
        "link": link,
        "least": None,
    }


def _series(name: str, color: str, values: np.ndarray, style: str = "line") -> dict[str, Any]:
    return {"name": name, "color": color, "style": style, "width": 1.5, "values": numbers(values)}


def _press(press: ImportedPress, number: int) -> dict[str, Any]:
    """Return depth and channels of a press over time, those that change most."""
    pick = picked(len(press.taxels.time_ns), POINTS)
    time_ns = press.taxels.time_ns[pick]
    seconds = (time_ns - time_ns[0]) / 1e9
    depth = np.interp(time_ns, press.position.time_ns, press.registration["origin"][2] - press.position.values[:, 2])
    change = press.taxels.values[pick] - _first(press.taxels.values)
    spans = np.nan_to_num(np.nanmax(np.abs(change), axis=0, initial=0.0))
    largest = sorted(np.argsort(-spans, kind="stable")[: len(COLORS)].tolist())
    unit, trial = press.taxels.unit or "as read", press.record["trial"]
    hidden = f", {len(largest)} of {len(spans)}" if len(largest) < len(spans) else ""
    channels = [_series(press.taxels.names[k], color, change[:, k]) for k, color in zip(largest, COLORS, strict=False)]
    name = f"press {number}" + f" ({trial})" * bool(trial)
    title, line = f"{name}: {press.press.depth:.3g} mm deep", _series("depth", "blue", depth)
    above = _figure(title, "depth [mm]", seconds, [line], "press")
    below = _figure(f"change of the channels{hidden}", f"change [{unit}]", seconds, channels, "press")
    return {"name": name, "depth": above, "channels": below}


def _first(values: np.ndarray) -> np.ndarray:
    """Return the first finite reading of each channel, shape (channels,)."""
    finite = np.isfinite(values)
    return np.where(finite.any(axis=0), values[finite.argmax(axis=0), np.arange(values.shape[1])], 0.0)


def _path(mapping: Mapping, run: TrialRun, memory: TableMemory) -> dict[str, Any] | None:
    """Return the position as read, of the first files with a press: its presses, and the rows that were set aside."""
    tried = [(files, presses) for files, presses in run.by_set if presses]
    if not tried or mapping.position is None:
        return None
    files, presses = tried[0]
    try:
        time_ns, depth = _read(mapping.position, memory.tables(files)[mapping.position.file], presses[0])
    except TacdataError:
        return None
    finite = np.isfinite(depth) & (time_ns != NEVER)
    time_ns, depth = time_ns[finite], depth[finite]
    if len(depth) < 2:
        return None
    names = ", ".join(file.paths[0].name for file in files.files.values())
    title = f"{len(presses)} press{'es' * (len(presses) > 1)} found in {names}"
    if (np.diff(time_ns) < 0).any():
        # Rows of different stretches have one time: they are drawn by their order.
        pick = picked(len(depth), LONG)
        series = [_series("as read", "ink", depth[pick])]
        return _figure(f"{title}; time goes back, so rows are drawn", "depth [mm]", pick.astype(float), series, x="row")
    members, covered = np.zeros(len(depth), int), np.zeros(len(depth), bool)
    tolerance = 0.5 * float(np.median(np.abs(np.diff(time_ns))))
    for number, press in enumerate(presses, 1):
        press_times = np.sort(press.position.time_ns - press.record["time_shift_ns"])
        members[(time_ns >= press_times[0] - tolerance) & (time_ns <= press_times[-1] + tolerance)] = number
        following = np.searchsorted(press_times, time_ns)
        distances = [
            np.abs(time_ns - press_times[np.clip(rows, 0, len(press_times) - 1)]) for rows in (following - 1, following)
        ]
        covered |= np.minimum(*distances) <= tolerance
    aside = (members > 0) & ~covered
    pick = np.union1d(picked(len(depth), LONG), np.flatnonzero(aside)[:LONG])
    depth, members, aside = depth[pick], members[pick], aside[pick]
    series = [
        _series("in no press", "grey", np.where(members == 0, depth, np.nan)),
        _series("presses 1, 3, …" if len(presses) > 1 else "press", "blue", np.where(members % 2 == 1, depth, np.nan)),
        _series("presses 2, 4, …", "green", np.where((members > 0) & (members % 2 == 0), depth, np.nan)),
        _series("set aside", "vermilion", np.where(aside, depth, np.nan), "points"),
    ]
    drawn = [each for each in series if any(value is not None for value in each["values"])]
    return _figure(title, "depth [mm]", (time_ns[pick] - time_ns.min()) / 1e9, drawn)


def _read(position: PositionEntry, table: SourceTable, press: ImportedPress) -> tuple[np.ndarray, np.ndarray]:
    """Return times [ns] and depths [mm] of the position as the files have it, shape (rows,)."""
    time_ns, _ = times(table, position.clock, "position: time")
    key = "depth" if position.depth_given else "z"
    values = axis(table, position.axes[key], "mm", "position", position.missing)
    values = np.broadcast_to(values, time_ns.shape).astype(float)
    return time_ns, values if position.depth_given else press.registration["origin"][2] - values
