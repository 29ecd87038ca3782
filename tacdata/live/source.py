"""Finds the board to read: the only one of a rig, or that of one finger of a demo rig."""

from dataclasses import dataclass
from pathlib import Path

from tacdata import documents
from tacdata.clock import Clock
from tacdata.demonstrations.recording.rig import read_demo_rig
from tacdata.devices.device import TaxelBoard, create
from tacdata.errors import UsageError
from tacdata.rig import read_rig
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Source:
    """A board with its sensor and rate."""

    name: str
    """The finger, or the sensor's name."""
    board: TaxelBoard
    """The board, not opened yet."""
    clock: Clock
    sensor: Sensor
    rate: float
    """Nominal frame rate [Hz]."""


def touched_board(path: Path, finger: str | None, assumed: Sensor) -> Source:
    """Return the board of a rig file or, of a demo rig file, of one finger (by default the first).

    Args:
        path: The file.
        finger: Whose board.
        assumed: The sensor where the file names none: a rig file does not.

    Raises:
        UsageError: If there is no file, no such finger, or a finger is asked of a rig.
        FormatError: If the file is neither.
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", "a rig or demo rig file", "check the path")
    content = documents.content_of(path, "rig")
    if isinstance(content, dict) and "boards" in content:
        demo = read_demo_rig(path)
        name = finger or next(iter(demo.boards), "")
        if name not in demo.boards:
            fingers = ", ".join(demo.boards) or "a demo rig with boards"
            raise UsageError(f"no board for finger {name!r} in {path}", fingers, "name it with --finger")
        entry, clock, sensor = demo.boards[name], demo.clock, demo.sensors[name]
    else:
        rig = read_rig(path)
        if finger is not None:
            fault = f"finger {finger} of rig {rig.name}"
            raise UsageError(fault, "a demo rig, which has fingers", "leave it out: a rig has one board")
        name, entry, clock, sensor = assumed.name, rig.board, rig.clock, assumed
    board = create(entry, TaxelBoard, clock)
    return Source(name, board, clock, sensor, board.describe()["rate"]["nominal"] or sensor.taxels.rate)
