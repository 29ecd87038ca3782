"""Threads that write every sample of the boards, and keep the newest one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lerobot_robot_tacdata.prediction import Prediction
from tacdata.devices.device import TaxelBoard, TaxelFrame
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.device_streams import DeviceStreams

FIRST = 5.0
"""Time allowed for the first sample of every board [s]."""


@dataclass(frozen=True)
class Header:
    """Documents attached to a recording."""

    identity: int
    """Number that the rows of a dataset carry."""
    boards: dict[str, Any]
    """Descriptions of the boards: unit, channels, rate, frame format."""
    sensors: dict[str, Any]
    """Sensor of each board."""
    networks: dict[str, Any]
    """Identity of each network that predicts."""

    @property
    def attachments(self) -> dict[str, Any]:
        """Name of each attachment and its document."""
        return {
            "lerobot.json": {"identity": self.identity, "networks": self.networks},
            "boards.json": self.boards,
            "sensors.json": self.sensors,
        }


class BoardStreams(DeviceStreams):
    """A context that writes all samples into one recording."""

    silence = 1.5

    def __init__(
        self, boards: dict[str, TaxelBoard], writer: EpisodeWriter, predictions: Mapping[str, Prediction]
    ) -> None:
        """Prepare the threads.

        Args:
            boards: The opened boards, by finger.
            writer: The recording.
            predictions: Live predictions, by finger.
        """
        super().__init__(boards, {}, {})
        self._names, self._writer, self._predictions = tuple(boards), writer, predictions
        self._newest: dict[str, tuple[int, np.ndarray]] = {}
        self._why = ""
        # The streams see this object as their recording: numbers are counted in the order of writing.
        self.begun_ns = writer.begun_ns
        self.record_into(self)  # ty: ignore[invalid-argument-type]

    def __exit__(self, *exception: object) -> None:
        """Stop the threads and close the recording."""
        self.catch_up()
        counts, models = self.counts, self.clock_models
        super().__exit__(*exception)
        self._writer.close(not self._why, self._why, models, counts)

    def taxels(self, frame: TaxelFrame, sample_ns: int, board: str) -> None:
        """Write a sample; keep it as the newest one."""
        self._writer.taxels(frame, sample_ns, board)
        number = self._newest[board][0] + 1 if board in self._newest else 0
        self._newest[board] = number, frame.counts
        if board in self._predictions:
            self._predictions[board].push(frame)

    def newest(self) -> dict[str, tuple[int, np.ndarray]]:
        """Return number and readings [counts] of the newest sample of each board.

        Raises:
            DeviceError: If a board fell silent or broke, or writing failed.
        """
        if self._writer.failure is not None:
            self._why = f"writing failed: {self._writer.failure}"
        if self._why:
            raise DeviceError(self._why, "every board until the end", "check cable, power and disk, then record again")
        with self._lock:
            return dict(self._newest)

    def wait(self) -> None:
        """Wait for the first sample of every board.

        Raises:
            DeviceError: If one of them does not come.
        """
        end = self._host.monotonic() + FIRST
        while missing := set(self._names) - set(self.newest()):
            if self._host.monotonic() > end:
                raise DeviceError(
                    f"no sample of {', '.join(sorted(missing))} within {FIRST:g} s", "a board that sends", "check it"
                )
            self._host.sleep(0.01)

    def _silent(self, name: str) -> None:
        self._why = f"{name}: {self._what(name)} for {self.silence:g} s{self._busy(name)}"

    def _broken(self, name: str, error: TacdataError) -> None:
        self._why = f"{name}: {error.given}"

    def _delivered(self, name: str, count: int) -> None:
        pass
