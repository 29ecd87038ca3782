"""The board driver against an emulated board, through a real pseudo-terminal."""

import threading
import time

import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.capacitive_board import CapacitiveBoard
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.virtual_rig.board import Timing, VirtualBoard, draw_timing
from tacdata.virtual_rig.firmware.controller import Controller
from tacdata.virtual_rig.port import VirtualPort
from tacdata.wire import default_format
from tacdata.wire.frames.frame_format import from_document

RATE = 8.0
S = 1_000_000_000


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr("tacdata.devices.capacitive_board.FIRST_FRAME", 0.6)


@pytest.fixture
def board():
    clock = Clock.start(RATE)
    emulated = VirtualBoard(
        clock, default_format(), draw_timing(3, clock.now_ns(), 30.0), lambda t: np.full(24, t // 1_000_000 % 50_000)
    )
    emulated.start()
    yield clock, emulated
    emulated.stop()


def gather(driver, count):
    frames, end = [], time.monotonic() + 20
    while time.monotonic() < end:
        frames += driver.read(1.0)
        if len(frames) >= count:
            return frames
    raise AssertionError(f"{len(frames)} of {count} frames")


def test_frames_at_30_hz_none_lost(board):
    clock, emulated = board
    with CapacitiveBoard(clock, emulated.port.path) as driver:
        frames = gather(driver, 90)
        counts = driver.counts
    counters = np.array([f.counter for f in frames])
    assert np.array_equal(np.diff(counters), np.ones(len(frames) - 1))
    assert (counts.lost, counts.repeated, counts.corrupt, counts.garbage_bytes) == (0, 0, 0, 0)
    arrivals = np.array([f.arrival_ns for f in frames])
    sampled = np.array([emulated.timing.sample_ns(c) for c in counters])
    assert (len(frames) - 1) / ((sampled[-1] - sampled[0]) / S) == pytest.approx(30, rel=1e-3)
    assert np.all(np.diff(arrivals) >= 0)
    # conversion 1 ms, 54 bytes at 115200 baud 4.7 ms, then the bridge's timer: never earlier
    assert ((arrivals - sampled) * 1e-9).min() > 0.0056
    for frame, time_ns in zip(frames, sampled, strict=True):
        assert np.array_equal(frame.counts, np.full(24, time_ns // 1_000_000 % 50_000))


def test_description_needs_no_port():
    said = CapacitiveBoard(Clock.start(), "/dev/nowhere").describe()
    assert said["channels"] == 24
    assert said["rate"] == {"nominal": 30.0, "unit": "Hz"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sync": [1, 2]}, r"sync 01 02 is not among them"),
        ({"channels": {"count": 16, "type": "uint16"}}, r"refused(.|\n)*16 channels"),
        ({"checksum": {"kind": "crc16_modbus"}}, r"crc16_modbus checksum"),
        ({"encoding": "ascii", "sync": "", "checksum": {"kind": "none"}}, r"25 numbers"),
    ],
)
def test_wrong_format_says_what_came(board, change, words):
    clock, emulated = board
    layout = {**default_format().document, **change}
    with pytest.raises(DeviceError, match=rf"bytes came, beginning(.|\n)*{words}"):
        CapacitiveBoard(clock, emulated.port.path, format=layout).open()


def test_wrong_baud_points_at_the_baud(board):
    clock, emulated = board
    with pytest.raises(DeviceError, match=r"at 9600 baud: \d+ bytes came(.|\n)*baud"):
        CapacitiveBoard(clock, emulated.port.path, baud=9600).open()


def test_silent_board():
    port = VirtualPort(115200)
    with pytest.raises(DeviceError, match="not one byte came"):
        CapacitiveBoard(Clock.start(), port.path).open()
    port.close()


def test_a_controller_on_the_boards_port_is_named():
    clock = Clock.start()
    controller = Controller(clock, 1)
    threading.Timer(0.2, lambda: controller.port.write(b"\r\nGrbl 1.1h ['$' for help]\r\n")).start()
    with pytest.raises(DeviceError, match=r"a GRBL controller is on(.|\n)*swap port"):
        CapacitiveBoard(clock, controller.port.path).open()
    controller.port.close()


def test_pulled_cable_hands_out_what_came_before(board):
    clock, emulated = board
    with CapacitiveBoard(clock, emulated.port.path) as driver:
        gather(driver, 5)
        time.sleep(0.1)
        emulated.port.close()
        time.sleep(0.1)
        assert len(driver.read(0.0)) > 10
        with pytest.raises(DeviceError, match="broke"):
            driver.read(5.0)


def test_garbage_and_damage_are_counted(board):
    clock, emulated = board
    with CapacitiveBoard(clock, emulated.port.path) as driver:
        first = gather(driver, 5)
        for junk in (b"\x00" * 40, b"\xa5\x5a\x01\x02"):
            emulated.port.write(junk)
            gather(driver, 10)
        last = gather(driver, 10)[-1].counter
        counts = driver.counts
    assert counts.received == last - first[0].counter + 1 - counts.lost
    assert counts.lost <= 2
    assert counts.garbage_bytes + 54 * counts.corrupt >= 40


def test_missing_port_and_format():
    with pytest.raises(DeviceError, match="no port /dev/ttyNOPE for the taxel board"):
        CapacitiveBoard(Clock.start(), "/dev/ttyNOPE").open()
    with pytest.raises(UsageError, match="no file"):
        CapacitiveBoard(Clock.start(), "p", format="missing.yaml")
    with pytest.raises(FormatError, match="channels"):
        CapacitiveBoard(Clock.start(), "p", format={"version": "1.0", "name": "x", "encoding": "ascii", "rate": 1})


def test_read_waits_no_longer_than_asked(board):
    clock, emulated = board
    with CapacitiveBoard(clock, emulated.port.path) as driver:
        begun = clock.now_ns()
        for _ in range(5):
            driver.read(0.01)
        assert (clock.now_ns() - begun) * 1e-9 < 20


def test_1_khz_through_a_fast_line():
    clock = Clock.start(1.0)
    layout = from_document({**default_format().document, "rate": 1000}, "test")
    timing = Timing(clock.now_ns(), 0.001, 100.0, 0.0, 600.0, 0.0001, 0.001)
    emulated = VirtualBoard(clock, layout, timing, lambda t: np.zeros(24), baud=921600)
    emulated.start()
    try:
        with CapacitiveBoard(clock, emulated.port.path, 921600, layout.document) as driver:
            frames = gather(driver, 500)
            assert driver.counts.lost == driver.counts.corrupt == 0
    finally:
        emulated.stop()
    assert np.array_equal(np.diff([f.counter for f in frames]), np.ones(len(frames) - 1))
