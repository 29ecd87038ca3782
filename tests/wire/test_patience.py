"""Limits on waiting: a host that stood still has not waited; a line that takes nothing is given up."""

import os
import threading
import time

import pytest
import serial

from tacdata.host import Host
from tacdata.wire import serial_port
from tacdata.wire.patience import Patience


class Shown(Host):
    """A computer whose time is set by hand."""

    time = 100.0

    def monotonic(self):
        return self.time


@pytest.fixture
def host():
    return Shown()


def test_it_runs_out_after_its_time(host):
    patience = Patience(3.0, host=host)
    for _ in range(30):
        host.time += 0.1
        assert not patience.over()
    host.time += 0.1
    assert patience.over()
    patience.restart()
    assert not patience.over()


def test_a_stall_counts_as_one_look(host):
    patience = Patience(3.0, host=host)
    host.time += 3600.0
    assert not patience.over()
    for _ in range(27):
        host.time += 0.1
        assert not patience.over()
    host.time += 0.1
    assert patience.over()


def test_a_fast_clock_leaves_a_floor_of_real_time(host):
    patience = Patience(3.0, rate=10.0, host=host)
    for _ in range(9):
        host.time += 0.1
        assert not patience.over()
    host.time += 0.2
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
