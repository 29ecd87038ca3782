"""Capacitive taxel boards on a serial port, whatever their frame format."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import serial

from tacdata.clock import Clock
from tacdata.devices.device import StreamCounts, TaxelBoard, TaxelFrame
from tacdata.errors import DeviceError
from tacdata.wire import Decoder, FrameFormat, default_format, read_format
from tacdata.wire.frames.frame_format import from_document
from tacdata.wire.grbl.lines import WELCOME
from tacdata.wire.patience import Lateness, Patience
from tacdata.wire.serial_port import bytes_waiting, open_port, read_available, why_broken

FINE_TICK = 0.0002
"""Coarsest tick of a board's own time stamp that is preferred to its frame counter [s]."""
READ = 0.05
"""Timeout of one read [s, real time]."""
FIRST_FRAME = 2.0
"""Timeout for the first good frame [s, real time]."""


class CapacitiveBoard(TaxelBoard):
    """A board that streams frames by itself.

    Settings in the rig file:

    - ``port``, ``baud`` (115200);
    - ``format``: path of a frame format file, or the format itself (default: tacdata/wire/cap24.yaml).
    """

    def __init__(self, clock: Clock, port: str, baud: int = 115200, format: str | dict[str, Any] | None = None) -> None:
        """Keep the settings and read the format; see the class.

        Raises:
            UsageError: If the format file does not exist.
            FormatError: If the format is damaged.
        """
        super().__init__(clock)
        self.port, self.baud = port, baud
        self.format = _format(format)
        self.counts = StreamCounts()
        self._line: serial.SerialBase | None = None
        self._decoder = Decoder(self.format)
        self._frames: list[TaxelFrame] = []
        self._seen = bytearray()
        self._fault: DeviceError | None = None
        self._changed = clock.host.condition()
        self._stopped = clock.host.event()
        self._thread: threading.Thread | None = None
        self._reader = Lateness(2 * READ, clock.host)

    def describe(self) -> dict[str, Any]:
        """Return channels, type, rate and the frame format."""
        return {
            "kind": "taxel board",
            "driver": "capacitive_board",
            "port": self.port,
            "baud": self.baud,
            "channels": self.format.channels,
            "unit": "counts",
            "shape": [self.format.channels],
            "rate": {"nominal": self.format.rate, "unit": "Hz"},
            "format": self.format.document,
            "clock": self._clock_axis(),
        }

    def _clock_axis(self) -> str:
        # A counter is exact where sampling is regular; the board's own time stamp is better if its ticks are fine
        # enough.
        fine = self.format.timestamp is not None and self.format.tick <= FINE_TICK
        return "device_ns" if fine or (self.format.timestamp and not self.format.counter) else "counter"

    def open(self) -> None:
        """Open the port and wait for the first good frame.

        Raises:
            DeviceError: If the port is missing or busy, or no good frame comes within 2 s.
        """
        self._line = open_port(self.port, self.baud, "taxel board", READ)
        self._decoder = Decoder(self.format)
        self.counts = self._decoder.counts
        self._frames, self._seen, self._fault = [], bytearray(), None
        self._stopped.clear()
        self._thread = self.clock.host.thread(self._listen, "taxel-board")
        self._thread.start()
        patience = Patience(FIRST_FRAME, host=self.clock.host)
        with self._changed:
            while not (self._frames or self._fault or patience.over(self.late)):
                self._changed.wait(READ)
            begun, fault = bool(self._frames), self._fault
        if not begun:
            self.close()
            raise fault or self._nothing_understood()

    def close(self) -> None:
        """Close the port; never raises."""
        self._stopped.set()
        if self._thread is not None:
            # A read that hangs in the driver must not hang the program's end.
            self._thread.join(timeout=2.0)
            self._thread = None
        if self._line is not None:
            try:
                self._line.close()
            except (serial.SerialException, OSError):
                pass
            self._line = None

    @property
    def late(self) -> float:
        """Lateness in reading frames that wait in the port [s, real time]."""
        return self._reader.seconds if self._line is not None and bytes_waiting(self._line) else 0.0

    def read(self, timeout: float) -> list[TaxelFrame]:
        """Return the received frames, waiting at most ``timeout`` [s of the clock] for something.

        Raises:
            DeviceError: If the line broke and every frame before that has been handed out.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._frames or self._fault, max(timeout, 0.0) / self.clock.rate)
            frames, self._frames = self._frames, []
            if not frames and self._fault:
                raise DeviceError(self._fault.given, self._fault.allowed, self._fault.remedy)
        return frames

    def _listen(self) -> None:
        line, begun = self._line, False
        while line is not None and not self._stopped.is_set():
            try:
                data = read_available(line)
            except (serial.SerialException, OSError, TypeError) as error:
                # pyserial raises a TypeError where another thread has closed the port.
                if not self._stopped.is_set():
                    self._break(error)
                return
            # Before decoding, whose duration would count as latency of the link.
            arrival_ns = self.clock.now_ns()
            self._reader.look()
            if not data:
                continue
            self._reader.restart()
            with self._changed:
                # The first bytes, for the error of a stream in which no frame was found.
                self._seen += data[: max(0, 4096 - len(self._seen))]
                frames = self._decoder.feed(data, arrival_ns)
                if frames and not begun:
                    begun = True
                    self._forget_partial_frame()
                self._frames += frames
                self._changed.notify_all()

    def _forget_partial_frame(self) -> None:
        # The port is opened in the middle of a frame: a few bytes before the first good one are no fault of the stream.
        # Two damaged frames, or more bytes than some frames have, are noted.
        counts, allowance = self.counts, 4 * self.format.size if self.format.encoding == "binary" else 4096
        if counts.corrupt > 1 or counts.garbage_bytes > allowance:
            counts.notes.append(f"{counts.garbage_bytes} B, {counts.corrupt} frames were damaged at first")
        # What follows is counted from the first good frame on.
        counts.garbage_bytes = counts.corrupt = 0

    def _break(self, error: Exception) -> None:
        with self._changed:
            self._fault = DeviceError(
                f"the line to the taxel board on {self.port} broke: {why_broken(error)}",
                "a port that stays connected",
                "check the cable and the power; what was received so far is kept",
            )
            self._changed.notify_all()

    def _nothing_understood(self) -> DeviceError:
        sample, layout, counts = bytes(self._seen), self.format, self.counts
        wait, limit = (
            f"no {layout.name} frame on {self.port} within {FIRST_FRAME:g} s at {self.baud} baud",
            "good frames",
        )
        if not sample:
            return DeviceError(
                f"{wait}: not one byte came",
                limit,
                "check power, cable and port (the rig file may have swapped those of cnc and board), and whether the "
                "board must be started",
            )
        if WELCOME.search(sample.decode("ascii", "replace")):
            return DeviceError(
                f"a GRBL controller is on the taxel board's port {self.port}",
                "a taxel board on that port",
                "swap port under cnc and port under board in the rig file",
            )
        what = f"{wait}: {len(sample)} bytes came, beginning {sample[:24].hex(' ')}"
        if layout.sync and layout.sync not in sample:
            return DeviceError(
                f"{what}; the sync {layout.sync.hex(' ')} is not among them",
                f"frames that begin with {layout.sync.hex(' ')}",
                "check the baud rate first, then sync in the frame format",
            )
        return DeviceError(
            f"{what}; {max(counts.corrupt, 1)} or more frames were refused",
            f"frames of {layout.size} bytes, {layout.channels} channels, a right {layout.checksum} checksum"
            if layout.encoding == "binary"
            else f"lines of {layout.channels + len(layout.order) - 1} numbers",
            "check channels, counter and checksum in the frame format, then the baud rate",
        )


def _format(source: str | dict[str, Any] | None) -> FrameFormat:
    if source is None:
        return default_format()
    return from_document(source, "board: format") if isinstance(source, dict) else read_format(Path(source))
