"""Live estimates: of the right frame, said how old, and never waited for."""

import json
import socket
import time

import numpy as np
import pytest

from tacdata import documents
from tacdata.devices.device import StreamCounts, TaxelBoard, TaxelFrame
from tacdata.errors import UsageError
from tacdata.live.depth_stream import DepthStream, contact_centre
from tacdata.live.latency_meter import LatencyMeter
from tacdata.live.live_loop import LiveLoop
from tacdata.live.message_server import WAITING, MessageServer, message
from tacdata.live.source import Source, touched_board
from tacdata.recording.clocks.running_clock import StreamClock
from tacdata.sensor import default_sensor

SENSOR = default_sensor()
PERIOD = 33_333_333
CENTRED = tuple(range(-4, 5))


def frame(number, value=None, arrival=None):
    counts = np.full(24, 9000.0 if value is None else 9000.0 + value)
    return TaxelFrame(number * PERIOD if arrival is None else arrival, number, counts)


def newest_of(window):
    """A stand-in network: the map holds the window's middle, its last and its first reading."""
    depth = np.zeros((35, 26), np.float32)
    depth[0, :3] = window[len(window) // 2, 0], window[-1, 0], window[0, 0]
    return depth


def stream(offsets=CENTRED, causal=False, tare=3):
    return DepthStream(newest_of, offsets, SENSOR.map, StreamClock(), tare, causal)


def run(made, count=30):
    return [e for k in range(count) if (e := made.push(frame(k, 0 if k < 3 else k)))]


def test_a_centred_window_estimates_the_frame_four_before_the_newest():
    found = run(stream())
    # Frames 3 and on are not for taring; the first estimate is of frame 3, once frame 7 has come.
    assert [int(e.depth[0, 0]) for e in found] == list(range(3, 26))
    assert [int(e.depth[0, 1]) for e in found] == list(range(7, 30))
    assert [int(e.depth[0, 2]) for e in found[:6]] == [3, 3, 3, 3, 3, 4]  # frames before the first are like it
    assert found[10].arrival_ns - found[10].sample_ns >= 4 * PERIOD - 1e6
    assert [e.sequence for e in found] == list(range(23))


def test_a_causal_estimate_is_of_the_newest_frame_which_stands_for_those_to_come():
    made = stream(causal=True)
    found = run(made)
    assert made.lookahead == 0
    assert [int(e.depth[0, 0]) for e in found] == list(range(3, 30))
    assert all(e.depth[0, 1] == e.depth[0, 0] for e in found)
    assert abs(found[-1].arrival_ns - found[-1].sample_ns) < 1e6


def test_a_network_without_look_ahead_waits_for_nothing():
    made = stream(tuple(range(-8, 1)))
    assert made.lookahead == 0
    assert [int(e.depth[0, 1]) for e in run(made)] == list(range(3, 30))


def test_taring_waits_until_nothing_moves_the_skin():
    made = stream(tare=20)
    for k in range(20):
        made.push(frame(k, 40.0 * k))
    assert "while it was tared" in made.waiting_for_rest and made.baseline is None
    for k in range(20, 45):
        made.push(frame(k, 800.0))
    assert not made.waiting_for_rest
    np.testing.assert_allclose(made.baseline, 9800.0)
    with pytest.raises(UsageError, match="taring over 0"):
        stream(tare=0)


def test_a_skin_that_was_held_while_it_was_tared_shows_itself_when_it_is_let_go():
    """Held still it looks like rest, so depth reads 0 in the hand; let go, every reading lies below the tare."""
    made = stream(causal=True, tare=10)
    found = [made.push(frame(k, 1500.0 if k < 30 else 0.0)) for k in range(60)]
    assert [e.below_tare for e in found[10:30] if e] == [0.0] * 20
    assert found[-1].below_tare == pytest.approx(1500.0)
    line = message(found[-1], {"finger": "a", "network": "b", "causal": True, "lookahead": 0}, 0, maps=False)
    assert line["below_tare"] == 1500.0
    documents.check(line, "live_message", "a message")
    made.tare()
    found = [made.push(frame(k, 0.0)) for k in range(60, 90)]
    assert found[:10] == [None] * 10 and found[-1].below_tare == 0.0


def test_noise_and_slow_drift_below_the_tare_are_no_touch():
    random, made = np.random.default_rng(0), stream(causal=True, tare=20)
    for k in range(400):
        counts = 9000 + random.normal(0, 4, 24) - 0.1 * k
        found = made.push(TaxelFrame(k * PERIOD, k, counts))
        assert found is None or found.below_tare == 0.0


def test_the_contact_centre_is_in_the_sensors_millimetres():
    depth = np.zeros((35, 26))
    assert contact_centre(depth, SENSOR.map) is None
    depth[20:23, 4:7] = 0.5
    assert contact_centre(depth, SENSOR.map) == pytest.approx(((21 - 17) * 0.4, (5 - 12.5) * 0.4))


def test_latencies_are_of_what_was_measured():
    meter = LatencyMeter()
    assert meter.figures is None
    for k in range(100):
        sample, late = k * 10_000_000, 50_000_000 if k == 99 else 0
        meter.take(sample, sample + 5_000_000, sample + 7_000_000 + late)
    assert meter.figures is not None
    assert meter.figures.age[0] == pytest.approx(7.0) and meter.figures.age[2] == pytest.approx(57.0)
    assert meter.figures.computing[0] == pytest.approx(2.0) and meter.figures.count == 100
    assert "7.0 ms median" in meter.figures.text


class Board(TaxelBoard):
    """A board whose frames are given in parts."""

    def __init__(self, clock, parts):
        super().__init__(clock)
        self.parts, self.counts = list(parts), StreamCounts()

    def describe(self):
        return {"rate": {"nominal": 30.0}, "clock": "counter"}

    def open(self):
        pass

    def close(self):
        pass

    def read(self, timeout):
        return self.parts.pop(0) if self.parts else []


class Frozen:
    """A clock that stands still."""

    rate = 1.0

    def __init__(self, now):
        self.now = now

    def now_ns(self):
        return self.now


def loop_over(parts, now, **more):
    clock = Frozen(now)
    made = LiveLoop(Source("index", Board(clock, parts), clock, SENSOR, 30.0), stream(causal=True), "f" * 64, **more)
    made.run(0.2, lambda words: None)
    return made


def test_behind_time_only_the_newest_frame_is_estimated():
    shown = []
    watch = lambda name, time_ns, value: shown.append((name, int(value[0][0, 0])))  # noqa: E731
    parts = [[frame(k, 0) for k in range(3)], [frame(3, 3)], [frame(k, k) for k in range(4, 24)]]
    made = loop_over(parts, 24 * PERIOD, watch=watch)
    # Frames that waited for more than two periods were passed over, those after them were not.
    assert shown == [("depth index", 3), ("depth index", 22), ("depth index", 23)]
    assert made.skipped == 18


def test_messages_reach_a_reader_as_the_schema_says():
    server = MessageServer(0)
    try:
        with socket.create_connection(("127.0.0.1", server.port), timeout=30) as reader:
            until = time.monotonic() + 30
            while not server.readers and time.monotonic() < until:
                time.sleep(0.01)
            (made,) = run(stream(causal=True), 4)
            about = {"finger": "index", "network": "f" * 64, "causal": True, "lookahead": 0}
            server.send(message(made, about, made.arrival_ns + 2_000_000))
            line = reader.makefile().readline()
        got = json.loads(line)
        documents.check(got, "live_message", "line")
        assert got["finger"] == "index" and got["age_ms"] == pytest.approx(2.0, abs=0.1)
        assert np.shape(got["map"]) == (35, 26) and got["contact"] is True
        short = message(made, about, made.arrival_ns, maps=False)
        documents.check(short, "live_message", "short")
        assert "map" not in short
    finally:
        server.close()


def test_a_reader_can_have_the_skin_tared_anew():
    server = MessageServer(0)
    try:
        loop = loop_over([[frame(k, 3)] for k in range(10)], 10 * PERIOD, server=server)
        with socket.create_connection(("127.0.0.1", server.port), timeout=30) as reader:
            reader.sendall(b"hello\n")
            reader.sendall(b"tare\r\n")
            until = time.monotonic() + 30
            while not loop._tare_wanted and time.monotonic() < until:
                time.sleep(0.01)
        assert loop._tare_wanted and loop._stream.baseline is not None
        said = []
        loop.run(0.1, said.append)
        assert said == ["index: taring again, do not touch the skin"] and loop._stream.baseline is None
    finally:
        server.close()


def test_an_estimate_from_readings_never_learnt_from_says_so():
    clock, said, shown = Frozen(10**12), [], []
    known = DepthStream(newest_of, (0,), SENSOR.map, StreamClock(), 3, novelty=lambda taxels: taxels[:, 0] / 10)
    parts = [[frame(k, 0 if k < 3 else k)] for k in range(20)]
    made = LiveLoop(
        Source("index", Board(clock, parts), clock, SENSOR, 30.0), known, "f" * 64, watch=lambda stream, ns, value: None
    )
    words, about = made._words, {"finger": "index", "network": "f" * 64, "causal": False, "lookahead": 0}
    for part in parts:
        estimate = known.push(part[0])
        if estimate is not None:
            shown.append(message(estimate, about, 1))
            said.append("a guess" in words(estimate))
    assert [m["novelty"] for m in shown] == pytest.approx([k / 10 for k in range(3, 20)])
    assert said == [k > 15 for k in range(3, 20)]
    documents.check(shown[-1], "live_message", "message")
    silent = run(stream())[-1]
    assert silent.novelty is None and "novelty" not in message(silent, {}, 1)


def test_a_reader_that_stalls_loses_messages_and_holds_up_nobody():
    server = MessageServer(0)
    try:
        stalled = socket.create_connection(("127.0.0.1", server.port), timeout=30)
        until = time.monotonic() + 30
        while not server.readers and time.monotonic() < until:
            time.sleep(0.01)
        for number in range(3000):
            server.send({"number": number, "filler": "x" * 5000})  # 15 MB, far more than any buffer
        lines, file = [], stalled.makefile()
        while lines[-1:] != [2999]:  # nothing comes after it
            lines.append(json.loads(file.readline())["number"])
        assert lines == sorted(lines) and len(lines) < 2900
        assert lines[-1] == 2999 and lines[-WAITING:] == list(range(3000 - WAITING, 3000))
        stalled.close()
    finally:
        server.close()
    server.close()


def test_a_taken_port_is_said():
    server = MessageServer(0)
    try:
        with pytest.raises(UsageError, match="port"):
            MessageServer(server.port)
        with pytest.raises(UsageError, match="port"):
            MessageServer(99999)
    finally:
        server.close()


def test_the_board_is_the_one_that_is_named(tmp_path):
    with pytest.raises(UsageError, match="no file"):
        touched_board(tmp_path / "none.yaml", None, SENSOR)
