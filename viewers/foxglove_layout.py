"""A layout for Foxglove, which shows a recording without our code."""

from itertools import cycle
from pathlib import Path
from typing import Any

from tacdata import documents
from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import read_records
from tacdata.viewers.output_file import new_file
from tacdata.viewers.scene.color_scale import HUES

ENDING = ".json"


def write_foxglove_layout(recording: Path, target: Path) -> None:
    """Write a layout that fits a recording's boards and cameras; in Foxglove: Layouts, Import from file.

    Args:
        recording: The recording (.mcap).
        target: New file (.json).

    Raises:
        UsageError: If there is no recording, or the file exists or does not end in .json.
        FormatError: If it is no MCAP file.
    """
    import json

    new_file(target, ENDING)
    records = read_records(recording, images=False)
    layout = foxglove_layout({channel.topic for channel in records.channels.values()})
    documents.write_text(target, json.dumps(layout, indent=1) + "\n")


def foxglove_layout(recorded: set[str]) -> dict[str, Any]:
    """Return a layout over those of a recording's topics that it has: readings, guide, images, phases, log.

    Args:
        recorded: The recording's topics.
    """
    panels: dict[str, dict[str, Any]] = {}
    for topic in sorted(t for t in recorded if t == topics.TAXELS or t.startswith(topics.TAXELS + "/")):
        panels[f"Plot!{_name(topic)}"] = _plot(f"{topic} [counts]", [f"{topic}.counts[:]"])
    if topics.STATUS in recorded:
        axes = [f"{topics.STATUS}.position.{axis}" for axis in "xyz"]
        panels["Plot!guide"] = _plot("Guide, machine position [mm]", axes)
    for topic in sorted(t for t in recorded if t.endswith("/image")):
        panels[f"Image!{_name(topic)}"] = {"imageMode": {"imageTopic": topic}}
    for topic in sorted(t for t in recorded if t.endswith("/image")):
        camera = topic.split("/")[2]
        poses = {t: {"visible": True, "type": "axis"} for t in sorted(recorded) if t.startswith(f"/camera/{camera}/")}
        poses = {t: entry for t, entry in poses.items() if t.endswith("/pose")}
        if poses:  # where the camera sees the cube, in the camera's own frame
            panels[f"3D!{_name(topic)}"] = {"followTf": camera, "followMode": "follow-none", "topics": poses}
    for topic in sorted(t for t in recorded if t.endswith("/cube") or t.endswith("/view")):
        panels[f"Plot!{_name(topic)}"] = _plot(f"{topic}: reprojection [px]", [f"{topic}.reprojection"])
    if topics.PHASE in recorded:
        phases = {"value": f"{topics.PHASE}.name", "timestampMethod": "receiveTime"}
        panels["StateTransitions!phases"] = {"isSynced": True, "paths": [phases]}
    if topics.LOG in recorded:
        panels["RosOut!log"] = {"topicToRender": topics.LOG, "minLogLevel": 1, "searchTerms": []}
    layout = {"configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1}}
    return layout | ({"layout": _split(list(panels))} if panels else {})


def _plot(title: str, paths: list[str]) -> dict[str, Any]:
    colors = ("#{:02x}{:02x}{:02x}".format(*hue) for hue in cycle(HUES))
    lines = [
        {"value": path, "enabled": True, "timestampMethod": "receiveTime", "color": color}
        for path, color in zip(paths, colors, strict=False)
    ]
    return {
        "title": title,
        "paths": lines,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": len(paths) > 1,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "legendDisplay": "floating",
    }


def _split(names: list[str], is_row: bool = True) -> Any:
    """Return a mosaic that halves the space again and again."""
    if len(names) == 1:
        return names[0]
    half = (len(names) + 1) // 2
    return {
        "direction": "row" if is_row else "column",
        "splitPercentage": 50,
        "first": _split(names[:half], not is_row),
        "second": _split(names[half:], not is_row),
    }


def _name(topic: str) -> str:
    return topic.strip("/").replace("/", "-")
