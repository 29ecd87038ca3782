"""Options of the robot `tacdata`, as `lerobot-record --robot.type=tacdata` reads them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lerobot.robots.config import RobotConfig


@dataclass
class BoardConfig:
    """A taxel board and the skin on it."""

    port: str
    """Serial port."""
    baud: int = 115200
    """Speed of the line [bit/s]."""
    format: Path | None = None
    """File of the frame format; tacdata's own by default."""
    sensor: Path | None = None
    """File of the sensor; tacdata's default one by default."""
    network: str | None = None
    """Run or checkpoint that predicts depth live; nothing is predicted by default."""
    tare: float = 1.0
    """Time at rest after connecting, over which readings are tared for the prediction [s]."""


@RobotConfig.register_subclass("tacdata")
@dataclass(kw_only=True)
class TacdataRobotConfig(RobotConfig):
    """A robot of any kind, and the boards on it."""

    arm: dict[str, Any] = field(default_factory=dict)
    """Type and options of the robot that wears the boards; empty for boards alone.

    As a mapping: draccus cannot nest a choice of robots in itself.
    """
    boards: dict[str, BoardConfig] = field(default_factory=dict)
    """Boards by the name of their finger."""
    records: Path = Path("touch_records")
    """Folder of the recordings at the boards' own rate; one file for each connection."""
