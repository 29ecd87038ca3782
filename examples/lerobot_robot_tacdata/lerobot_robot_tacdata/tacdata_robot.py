"""The robot `tacdata`: another robot's observations, and those of taxel boards."""

from __future__ import annotations

import secrets
from contextlib import ExitStack
from functools import cached_property
from typing import Any

import draccus
import numpy as np
from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot
from lerobot.robots.utils import make_robot_from_config

from lerobot_robot_tacdata.board_streams import BoardStreams, Header
from lerobot_robot_tacdata.config_tacdata import BoardConfig, TacdataRobotConfig
from lerobot_robot_tacdata.prediction import Prediction
from tacdata.clock import Clock
from tacdata.devices.device import TaxelBoard, create
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.sensor import Sensor, default_sensor, read_sensor

IDENTITIES = 1 << 24
"""Identities of recordings: whole numbers below it are exact in float32 [count]."""


class TacdataRobot(Robot):
    """A robot whose fingers wear taxel boards.

    Each observation has the newest reading of every board [counts], the sample's number in the recording, and the
    recording's identity. Both numbers lead from any row of a dataset to the samples around it, after any edit.
    """

    config_class = TacdataRobotConfig
    name = "tacdata"

    def __init__(self, config: TacdataRobotConfig) -> None:
        """Build the arm and the drivers; nothing is opened yet."""
        super().__init__(config)
        self.config = config
        self.arm = make_robot_from_config(draccus.decode(RobotConfig, config.arm)) if config.arm else None
        self.cameras: dict[str, Any] = getattr(self.arm, "cameras", {})
        self._clock = Clock.start()
        self._sensors = {name: _sensor(board) for name, board in config.boards.items()}
        self._boards = {name: create(_entry(board), TaxelBoard, self._clock) for name, board in config.boards.items()}
        self._predictions = {
            name: Prediction(board.network, board.tare, self._boards[name], self._sensors[name])
            for name, board in config.boards.items()
            if board.network
        }
        self._stack = ExitStack()
        self._streams: BoardStreams | None = None
        self._identity = 0

    @cached_property
    def observation_features(self) -> dict[str, type | tuple[int, ...]]:
        """The arm's features, and those of each board; each name ends in its unit."""
        features: dict[str, type | tuple[int, ...]] = dict(self.arm.observation_features) if self.arm else {}
        for name, board in self._boards.items():
            features |= dict.fromkeys(_taxels(name, board.describe()["channels"]), float)
            features |= {f"{name}.sample.count": float, f"{name}.record.id": float}
        for name, prediction in self._predictions.items():
            features |= {f"{name}.depth.mm": float, f"{name}_depth": prediction.picture.shape}
        return features

    @property
    def action_features(self) -> dict[str, type]:
        """The arm's features."""
        return self.arm.action_features if self.arm else {}

    @property
    def is_connected(self) -> bool:
        """Whether the arm and all boards are connected."""
        return self._streams is not None and (self.arm is None or self.arm.is_connected)

    @property
    def is_calibrated(self) -> bool:
        """Whether the arm is calibrated."""
        return self.arm is None or self.arm.is_calibrated

    def calibrate(self) -> None:
        """Calibrate the arm."""
        if self.arm:
            self.arm.calibrate()

    def configure(self) -> None:
        """Configure the arm."""
        if self.arm:
            self.arm.configure()

    def connect(self, calibrate: bool = True) -> None:
        """Open arm and boards, and begin a recording.

        Raises:
            DeviceError: If a board is missing or silent.
        """
        self._identity = secrets.randbelow(IDENTITIES - 1) + 1
        path = self.config.records / f"touch-{self._identity:08d}.mcap"
        path.parent.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            if self.arm:
                self.arm.connect(calibrate)
                stack.callback(self.arm.disconnect)
            for board in self._boards.values():
                stack.enter_context(board)
            described = {name: board.describe() for name, board in self._boards.items()}
            sensors = {name: sensor.document for name, sensor in self._sensors.items()}
            networks = {name: prediction.identity for name, prediction in self._predictions.items()}
            header = Header(self._identity, described, sensors, networks)
            writer = EpisodeWriter(path, header, self._clock, boards=tuple(self._boards))
            self._streams = stack.enter_context(BoardStreams(self._boards, writer, self._predictions))
            self._streams.wait()
            self._stack = stack.pop_all()

    def get_observation(self) -> dict[str, Any]:
        """Return the arm's observation and the newest sample of each board.

        Raises:
            DeviceError: If a board fell silent, or the disk refused a sample.
        """
        if self._streams is None:
            raise RuntimeError("the robot tacdata is not connected: connect it first")
        observation = dict(self.arm.get_observation()) if self.arm else {}
        for name, (number, counts) in self._streams.newest().items():
            observation |= zip(_taxels(name, len(counts)), counts.tolist(), strict=True)
            observation |= {f"{name}.sample.count": float(number), f"{name}.record.id": float(self._identity)}
        for name, prediction in self._predictions.items():
            depth, observation[f"{name}_depth"] = prediction.depth, prediction.picture
            observation[f"{name}.depth.mm"] = float(np.max(depth))
        return observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Hand an action to the arm."""
        return self.arm.send_action(action) if self.arm else action

    def disconnect(self) -> None:
        """Close everything; the recording ends."""
        self._streams = None
        self._stack.close()


def _sensor(board: BoardConfig) -> Sensor:
    return read_sensor(board.sensor) if board.sensor else default_sensor()


def _entry(board: BoardConfig) -> dict[str, Any]:
    entry: dict[str, Any] = {"driver": "capacitive_board", "port": board.port, "baud": board.baud}
    return entry | ({"format": str(board.format)} if board.format else {})


def _taxels(name: str, count: int) -> list[str]:
    return [f"{name}.taxel_{k:02d}.counts" for k in range(count)]
