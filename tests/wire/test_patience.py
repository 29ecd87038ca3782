"""Limits on waiting: a host that stood still has not waited; a line that takes nothing is given up."""

import os
import threading
import time

import pytest
import serial

from tacdata.wire import patience as patience_file
from tacdata.wire import serial_port
from tacdata.wire.patience import Patience


@pytest.fixture
def now(monkeypatch):
    shown = [100.0]
    monkeypatch.setattr(patience_file.time, "monotonic", lambda: shown[0])
    return shown


def test_it_runs_out_after_its_time(now):
    patience = Patience(3.0)
    for _ in range(30):
        now[0] += 0.1
        assert not patience.over()
    now[0] += 0.1
    assert patience.over()
    patience.restart()
    assert not patience.over()


def test_a_stall_counts_as_one_look(now):
    patience = Patience(3.0)
    now[0] += 3600.0
    assert not patience.over()
    for _ in range(27):
        now[0] += 0.1
        assert not patience.over()
    now[0] += 0.1
    assert patience.over()


def test_a_fast_clock_leaves_a_floor_of_real_time(now):
    patience = Patience(3.0, rate=10.0)
    for _ in range(9):
        now[0] += 0.1
        assert not patience.over()
    now[0] += 0.2
    assert patience.over()


@pytest.fixture
def line():
    outer, inner = os.openpty()
    port = serial_port.open_port(os.ttyname(inner), 115200, "motion controller", 0.05)
    yield outer, port
    port.close()
    os.close(outer)
    os.close(inner)


def test_a_line_that_takes_nothing_is_given_up(line, monkeypatch):
    monkeypatch.setattr(serial_port, "WRITE", 0.3)
    with pytest.raises(serial.SerialTimeoutException, match="takes no more bytes"):
        serial_port.write_all(line[1], bytes(1 << 20))


def test_a_line_that_is_slow_takes_all(line):
    outer, port = line
    heard = bytearray()

    def listen():
        while len(heard) < 20_000:
            heard.extend(os.read(outer, 512))
            time.sleep(0.001)

    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    serial_port.write_all(port, b"x" * 20_000)
    thread.join(10)
    assert len(heard) == 20_000
